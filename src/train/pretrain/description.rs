//! What a training says of itself: in its checkpoint, its state and its folder.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use super::Pretraining;
use crate::agent::config::{Beginning, Config, Ontology, Provenance, SentenceSpec};
use crate::data::atomic_file;
use crate::nets::visual::VisualSpec;
use crate::train::preset::Sight;

/// The datasets and how many of their trajectories are learned from, each once however often it is named. `parts` are the
/// datasets' trajectories.
pub(crate) fn each_once(digests: &[String], parts: &[Range<usize>], learned_from: &BTreeSet<u32>) -> (String, u64) {
    let (mut named, mut distinct) = (Vec::new(), BTreeSet::new());
    for (digest, part) in digests.iter().zip(parts) {
        if !named.contains(&digest.as_str()) {
            named.push(digest);
        }
        let within = learned_from.range(part.start as u32..part.end as u32);
        distinct.extend(within.map(|&trajectory| (digest, trajectory as usize - part.start)));
    }
    (named.join("-"), distinct.len() as u64)
}

/// A checkpoint that was begun with.
fn beginning(folder: Option<&Path>) -> anyhow::Result<Option<Beginning>> {
    let Some(folder) = folder else { return Ok(None) };
    let Provenance { preset, policy_steps, .. } = Config::read(folder)?.provenance;
    let name = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    let name = name.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    Ok(Some(Beginning { name, preset, policy_steps }))
}

impl Pretraining {
    /// The checkpoint's config after so many steps of the policy.
    pub(crate) fn config(&self, dataset: &str, trajectories: u64, policy_steps: u64) -> anyhow::Result<Config> {
        let embedder = self.sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
        Ok(Config {
            format_version: Config::FORMAT,
            ontology: Ontology::current(),
            visual: self.visual().cloned(),
            resnet18: None,
            method: Some(self.preset.method().to_string()),
            policy: self.preset.policy.clone(),
            critic: self.preset.critic.clone(),
            words: None,
            logit_adjustment: None,
            advantage_scale: self
                .preset
                .iql
                .as_ref()
                .map(|iql| iql.advantage_scale as f32)
                .filter(|&weight| weight > 0.0),
            sentence_encoder: SentenceSpec {
                name: self.sentence_encoder.clone(),
                digest: embedder.encoder().digest().to_string(),
            },
            provenance: Provenance {
                preset: self.preset.name.clone(),
                dataset: dataset.to_string(),
                trajectories,
                seed: self.preset.seed,
                visual_steps: match (self.preset.eyes, &self.visual_from) {
                    (Sight::ResNet18, _) => 0,
                    (Sight::House, Some(folder)) => Config::read(folder)?.provenance.visual_steps,
                    (Sight::House, None) => self.preset.visual_training.optimisation.steps,
                },
                policy_steps,
                precision: self.preset.precision,
                visual_from: beginning(self.visual_from.as_deref())?,
                policy_from: beginning(self.policy_from.as_deref())?,
                critic_from: beginning(self.critic_from.as_deref())?,
                averaged: None,
            },
        })
    }

    /// What a saved state of the visual encoder belongs to; `data` are the datasets' digests.
    pub(crate) fn visual_identity(&self, data: &str) -> BTreeMap<String, String> {
        [("format_version", "1".to_string()), ("dataset", data.to_string()), ("seed", self.preset.seed.to_string())]
            .map(|(name, value)| (name.to_string(), value))
            .into()
    }

    /// What a saved state belongs to: besides, `items` is the digest of what is learned and how it is told.
    pub(crate) fn identity(&self, encoder: &str, data: &str, items: &str, config: &Config) -> BTreeMap<String, String> {
        let mut identity = self.visual_identity(data);
        let further = [
            ("items", items.to_string()),
            ("ontology", format!("{} {}", config.ontology.classes, config.ontology.actions.join(" "))),
            ("visual_encoder", encoder.to_string()),
            ("sentence_encoder", config.sentence_encoder.digest.clone()),
            ("embedding", config.policy.embedding.to_string()),
        ];
        identity.extend(further.map(|(name, value)| (name.to_string(), value)));
        identity
    }

    /// The House encoder's size, where there is one.
    pub(crate) fn visual(&self) -> Option<&VisualSpec> {
        (self.preset.eyes == Sight::House).then_some(&self.preset.visual)
    }

    /// A training goes on only with the preset it began with.
    pub(crate) fn keep_preset(&self) -> anyhow::Result<()> {
        let path = self.out.join("training/preset.toml");
        let text = toml::to_string(&self.preset)?;
        match std::fs::read_to_string(&path) {
            Ok(begun) if begun == text => Ok(()),
            Ok(begun) => {
                let (own, other) = begun
                    .lines()
                    .zip(text.lines())
                    .find(|(begun, own)| begun != own)
                    .unwrap_or(("another number of lines", "this one"));
                anyhow::bail!(
                    "{}: the training was begun with another preset: {own} there, {other} here",
                    path.display()
                )
            }
            Err(_) => atomic_file::write(&path, text.as_bytes()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dataset_that_is_named_twice_is_told_of_once() {
        let digests = ["a", "b", "a"].map(String::from);
        let learned_from = BTreeSet::from([0, 2, 3, 5, 7]);
        assert_eq!(each_once(&digests, &[0..3, 3..5, 5..8], &learned_from), ("a-b".into(), 3));
    }
}
