//! What a training begins with: fresh networks, or another checkpoint's.

use std::path::Path;

use anyhow::Context;
use tch::nn::VarStore;

use super::spec::Pretraining;
use crate::agent::checkpoint::Networks;
use crate::agent::config::CheckpointConfig;
use crate::nets::size_differences::size_differences;
use crate::nets::visual_encoder::VisualEncoder;
use crate::nets::weights;
use crate::train::preset::VisualBackbone;

/// The networks before their first step: fresh ones by the preset's seed, over which those of other checkpoints are copied
/// where they were asked for.
pub(super) fn initial_networks(spec: &Pretraining) -> anyhow::Result<Networks> {
    check_sentence_width(spec)?;
    let preset = &spec.preset;
    tch::manual_seed(preset.seed as i64);
    let encoder = match preset.visual_backbone {
        VisualBackbone::House => VisualEncoder::house(&preset.visual_encoder, spec.device),
        VisualBackbone::ResNet18 => VisualEncoder::resnet18(&VisualEncoder::resnet18_file(), spec.device)?,
    };
    let networks = Networks::new(encoder, &preset.policy, preset.critic.as_ref(), spec.device);
    if let Some(folder) = &spec.visual_from {
        copy_visual_encoder(spec, folder, &networks)?;
    }
    if let Some(folder) = &spec.policy_from {
        copy_policy(spec, folder, &networks)?;
    }
    if let Some(folder) = &spec.critic_from {
        copy_critic(spec, folder, &networks)?;
    }
    Ok(networks)
}

fn check_sentence_width(spec: &Pretraining) -> anyhow::Result<()> {
    let Some(sentences) = spec.sentence_spec() else { return Ok(()) };
    let (own, width) = (spec.preset.policy.embedding, spec.embedder()?.encoder().width());
    anyhow::ensure!(
        own == width as i64,
        "the preset's policy.embedding is {own}, the width of the sentence encoder {} is {width}: name another with \
         --encoder",
        sentences.name
    );
    Ok(())
}

fn copy_visual_encoder(spec: &Pretraining, folder: &Path, networks: &Networks) -> anyhow::Result<()> {
    let own = networks
        .visual_encoder
        .store()
        .context("the preset's visual_backbone is ResNet-18: there is no visual encoder to take")?;
    let given = load(spec, folder)?.1.visual_encoder;
    copy(given.store().context("its visual encoder is no House encoder")?, own)
}

fn copy_policy(spec: &Pretraining, folder: &Path, networks: &Networks) -> anyhow::Result<()> {
    let (config, given) = load_of_same_sentences(spec, folder)?;
    let (found, own) = (&config.policy, &spec.preset.policy);
    let file = folder.join("config.json");
    anyhow::ensure!(
        found.fits(own),
        "{}: policy is of another size than the preset's: {}",
        file.display(),
        size_differences(found, own)
    );
    copy(&given.policy_store, &networks.policy_store)
}

fn copy_critic(spec: &Pretraining, folder: &Path, networks: &Networks) -> anyhow::Result<()> {
    let own = spec.preset.critic.as_ref().context("the preset's method has no critic to begin with another's")?;
    let file = folder.join("config.json");
    let found =
        CheckpointConfig::read(folder)?.critic.with_context(|| format!("{}: there is no critic", file.display()))?;
    let given = load_of_same_sentences(spec, folder)?.1;
    anyhow::ensure!(
        found.fits(own),
        "{}: critic is of another size than the preset's: {}",
        file.display(),
        size_differences(&found, own)
    );
    match (&given.critic, &networks.critic) {
        (Some(given), Some(own)) => copy(&given.online_store, &own.online_store),
        _ => Ok(()),
    }
}

/// A checkpoint of the preset's visual encoder and of this training's sentence encoder.
fn load_of_same_sentences(spec: &Pretraining, folder: &Path) -> anyhow::Result<(CheckpointConfig, Networks)> {
    let (config, given) = load(spec, folder)?;
    if let (Some(own), Some(found)) = (spec.sentence_spec(), config.read_sentences()) {
        anyhow::ensure!(
            found.digest == own.digest,
            "{}: sentence_encoder is {} ({}), this training's is {} ({})",
            folder.join("config.json").display(),
            found.name,
            found.digest,
            own.name,
            own.digest
        );
    }
    Ok((config, given))
}

/// A checkpoint whose visual encoder is of the preset's kind and size.
fn load(spec: &Pretraining, folder: &Path) -> anyhow::Result<(CheckpointConfig, Networks)> {
    let config = CheckpointConfig::read(folder)?;
    let file = folder.join("config.json");
    let (found, own) = (config.visual_encoder.as_ref(), spec.visual_spec());
    anyhow::ensure!(
        found == own,
        "{}: visual_encoder is of another size than the preset's: {}",
        file.display(),
        size_differences(&found, &own)
    );
    let networks = Networks::load(folder, &config, spec.device)?;
    Ok((config, networks))
}

fn copy(from: &VarStore, to: &VarStore) -> anyhow::Result<()> {
    weights::copy(&from.variables().into_iter().collect(), "", to)
}
