//! One policy of several: the mean of their weights (Wortsman et al., 2022, "Model soups"). Policies that were trained on from a
//! common start lie close enough for that, and their mean often does better than each of them where any of them does well.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use tch::{Device, Kind, Tensor};

use super::checkpoint::Networks;
use super::config::CheckpointConfig;
use crate::nets::size_differences::size_differences;

/// The mean of checkpoints' policies, each as often as it is named; visual encoder, critic and configuration are the first one's.
///
/// # Errors
/// When a checkpoint cannot be read, or differs from the first in its policy's size, its visual encoder or its sentence encoder.
pub(crate) fn average(folders: &[PathBuf], device: Device) -> anyhow::Result<(CheckpointConfig, Networks)> {
    let (first, others) = folders.split_first().context("no checkpoint was named")?;
    let (mut config, networks) = load(first, device)?;
    let encoder = networks.visual_encoder.frozen()?.digest().to_owned();
    let mut sums: Vec<(String, Tensor)> =
        networks.policy_store.variables().into_iter().map(|(name, own)| (name, own.to_kind(Kind::Double))).collect();
    for folder in others {
        let (found, given) = load(folder, device)?;
        same(folder, &found, &config)?;
        ensure!(
            given.visual_encoder.frozen()?.digest() == encoder,
            "{} has another visual encoder than {}",
            folder.display(),
            first.display()
        );
        let variables = given.policy_store.variables();
        for (name, sum) in &mut sums {
            *sum += variables.get(name).with_context(|| format!("{}: {name} is missing", folder.display()))?;
        }
        for (own, other, mark) in [
            (&mut config.provenance.preset, found.provenance.preset, " + "),
            (&mut config.provenance.dataset, found.provenance.dataset, "-"),
        ] {
            *own = joined(own, &other, mark);
        }
    }
    let count = (!others.is_empty()).then_some(folders.len() as u64);
    config.provenance.averaged_checkpoints = count.or(config.provenance.averaged_checkpoints);
    let mut variables = networks.policy_store.variables();
    tch::no_grad(|| -> anyhow::Result<()> {
        for (name, sum) in sums {
            let variable = variables.get_mut(&name).with_context(|| format!("{name} is missing"))?;
            variable.f_copy_(&(sum / folders.len() as f64))?;
        }
        Ok(())
    })?;
    Ok((config, networks))
}

fn load(folder: &Path, device: Device) -> anyhow::Result<(CheckpointConfig, Networks)> {
    let config = CheckpointConfig::read(folder)?;
    let networks = Networks::load(folder, &config, device)?;
    Ok((config, networks))
}

/// Both policies take in and put out the same.
fn same(folder: &Path, found: &CheckpointConfig, first: &CheckpointConfig) -> anyhow::Result<()> {
    let file = folder.join("config.json");
    let (own, others) = (&first.policy, &found.policy);
    ensure!(
        others.fits(own),
        "{}: its policy is of another size than the first one's: {}",
        file.display(),
        size_differences(others, own)
    );
    ensure!(found.vocabulary == first.vocabulary, "{}: vocabulary is not the first one's", file.display());
    if let (Some(own), Some(others)) = (first.read_sentences(), found.read_sentences()) {
        ensure!(
            own.digest == others.digest,
            "{}: sentence_encoder is {}, the first one's is {}",
            file.display(),
            others.name,
            own.name
        );
    }
    Ok(())
}

/// The parts of both, each once.
fn joined(one: &str, other: &str, mark: &str) -> String {
    let mut parts: Vec<&str> = one.split(mark).collect();
    for part in other.split(mark) {
        if !parts.contains(&part) {
            parts.push(part);
        }
    }
    parts.join(mark)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::config::tests::small;

    /// A checkpoint whose policy is one number everywhere, and whose visual encoder is another.
    fn checkpoint(policy: f64, encoder: f64, change: impl FnOnce(&mut CheckpointConfig)) -> tempfile::TempDir {
        let (folder, mut config) = (tempfile::tempdir().unwrap(), small());
        change(&mut config);
        let networks =
            Networks::new(config.build_visual_encoder(Device::Cpu).unwrap(), &config.policy, None, Device::Cpu);
        let fill = |store: &tch::nn::VarStore, number: f64| {
            tch::no_grad(|| store.variables().into_values().for_each(|mut tensor| drop(tensor.fill_(number))));
        };
        fill(&networks.policy_store, policy);
        fill(networks.visual_encoder.store().unwrap(), encoder);
        networks.save(folder.path(), &config).unwrap();
        folder
    }

    fn of(checkpoints: &[&tempfile::TempDir]) -> anyhow::Result<(CheckpointConfig, Networks)> {
        average(&checkpoints.iter().map(|folder| folder.path().to_owned()).collect::<Vec<_>>(), Device::Cpu)
    }

    #[test]
    fn each_policy_counts_as_often_as_it_is_named_and_the_visual_encoder_is_kept() {
        let _chance = crate::nets::testing::chance();
        let one = checkpoint(1.0, 0.5, |config| config.provenance.dataset = "a-b".into());
        let four = checkpoint(4.0, 0.5, |config| config.provenance.dataset = "b-c".into());
        let (config, networks) = of(&[&one, &four, &four]).unwrap();
        assert!(networks.policy_store.variables().values().all(|tensor| tensor.eq(3.0).all().int64_value(&[]) == 1));
        assert!(
            networks
                .visual_encoder
                .store()
                .unwrap()
                .variables()
                .values()
                .all(|t| t.eq(0.5).all().int64_value(&[]) == 1)
        );
        assert_eq!((config.provenance.dataset.as_str(), config.provenance.averaged_checkpoints), ("a-b-c", Some(3)));
    }

    #[test]
    fn what_does_not_go_with_the_first_is_refused() {
        let _chance = crate::nets::testing::chance();
        let one = checkpoint(1.0, 0.5, |_| ());
        let error = |other: tempfile::TempDir| format!("{:#}", of(&[&one, &other]).unwrap_err());
        assert!(error(checkpoint(1.0, 0.6, |_| ())).contains("another visual encoder"));
        let told = error(checkpoint(1.0, 0.5, |config| config.policy.hidden = vec![3]));
        assert!(told.contains("its policy is of another size") && told.contains("hidden: 3, not 8"), "{told}");
        assert!(!told.contains('{') && !told.contains('['), "in words: {told}");
        let strange = |config: &mut CheckpointConfig| config.sentence_encoder.as_mut().unwrap().digest = "0".into();
        assert!(error(checkpoint(1.0, 0.5, strange)).contains("sentence_encoder is"));
    }
}
