//! What a training says of itself: the checkpoint's `config.json`, and what a saved state belongs to.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use super::demonstrations::Demonstrations;
use super::spec::Pretraining;
use super::text_embeddings::Texts;
use crate::agent::config::{CheckpointConfig, Ontology, Provenance, SourceCheckpoint};
use crate::agent::logit_adjustment::LogitAdjustment;
use crate::data::items::Items;
use crate::nets::visual_encoder::VisualEncoder;
use crate::train::preset::VisualBackbone;

/// The checkpoint's configuration before the policy's first step.
pub(super) fn checkpoint_config(
    spec: &Pretraining,
    demonstrations: &Demonstrations,
    encoder: &VisualEncoder,
    items: &Items,
    texts: &Texts,
) -> anyhow::Result<CheckpointConfig> {
    let preset = &spec.preset;
    let learned_from: BTreeSet<u32> = items.training.iter().map(|span| span.trajectory).collect();
    let (dataset, trajectories) = each_once(&demonstrations.digests, &demonstrations.frame_store.parts, &learned_from);
    let advantage_scale = preset.iql.as_ref().map(|iql| iql.advantage_scale as f32);
    Ok(CheckpointConfig {
        format_version: CheckpointConfig::FORMAT,
        ontology: Ontology::current(),
        visual_encoder: spec.visual_spec().cloned(),
        resnet18: match encoder {
            VisualEncoder::House { .. } => None,
            VisualEncoder::ResNet18(_) => Some(encoder.frozen()?.digest().to_owned()),
        },
        method: Some(preset.method().to_string()),
        policy: preset.policy.clone(),
        critic: preset.critic.clone(),
        vocabulary: texts.vocabulary.as_ref().map(|vocabulary| vocabulary.words().to_vec()),
        logit_adjustment: Some(LogitAdjustment {
            strength: preset.logit_adjustment,
            action_frequencies: items.action_shares(),
        }),
        advantage_scale: advantage_scale.filter(|&scale| scale > 0.0),
        decision: preset.decision,
        loop_guard: preset.loop_guard,
        sentence_encoder: spec.sentence_spec().cloned(),
        provenance: Provenance {
            preset: preset.name.clone(),
            dataset,
            trajectories,
            seed: preset.seed,
            visual_encoder_steps: match (preset.visual_backbone, &spec.visual_from) {
                (VisualBackbone::ResNet18, _) => 0,
                (VisualBackbone::House, Some(folder)) => {
                    CheckpointConfig::read(folder)?.provenance.visual_encoder_steps
                }
                (VisualBackbone::House, None) => preset.visual_encoder_training.optimisation.steps,
            },
            policy_steps: 0,
            precision: preset.precision,
            visual_encoder_from: source_checkpoint(spec.visual_from.as_deref())?,
            policy_initialised_from: source_checkpoint(spec.policy_from.as_deref())?,
            critic_initialised_from: source_checkpoint(spec.critic_from.as_deref())?,
            averaged_checkpoints: None,
            finetuned_on: None,
        },
    })
}

/// The same after so many steps of the policy.
pub(super) fn after(steps: u64, config: &CheckpointConfig) -> CheckpointConfig {
    let provenance = Provenance { policy_steps: steps, ..config.provenance.clone() };
    CheckpointConfig { provenance, ..config.clone() }
}

/// The datasets and how many of their trajectories are learned from, each once however often it is named. `parts` are the
/// datasets' trajectories.
fn each_once(digests: &[String], parts: &[Range<usize>], learned_from: &BTreeSet<u32>) -> (String, u64) {
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

fn source_checkpoint(folder: Option<&Path>) -> anyhow::Result<Option<SourceCheckpoint>> {
    let Some(folder) = folder else { return Ok(None) };
    let Provenance { preset, policy_steps, .. } = CheckpointConfig::read(folder)?.provenance;
    let name = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    let name = name.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    Ok(Some(SourceCheckpoint { name, preset, policy_steps }))
}

/// What a saved state of the visual encoder belongs to; `data` is the datasets' digest.
pub(super) fn visual_identity(spec: &Pretraining, data: &str) -> BTreeMap<String, String> {
    [("format_version", "1".to_string()), ("dataset", data.to_string()), ("seed", spec.preset.seed.to_string())]
        .map(|(name, value)| (name.to_string(), value))
        .into()
}

/// What a saved state of policy and critic belongs to: besides, the items with their texts, and both encoders.
pub(super) fn identity(
    spec: &Pretraining,
    data: &str,
    encoder_digest: &str,
    items: &Items,
    config: &CheckpointConfig,
) -> BTreeMap<String, String> {
    let mut identity = visual_identity(spec, data);
    let further = [
        ("items", items.digest()),
        ("ontology", format!("{} {}", config.ontology.classes, config.ontology.actions.join(" "))),
        ("visual_encoder", encoder_digest.to_string()),
        ("sentence_encoder", spec.sentence_spec().map_or_else(String::new, |sentences| sentences.digest.clone())),
        ("embedding", config.policy.embedding.to_string()),
    ];
    identity.extend(further.map(|(name, value)| (name.to_string(), value)));
    identity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dataset_that_is_named_twice_is_listed_once() {
        let digests = ["a", "b", "a"].map(String::from);
        let learned_from = BTreeSet::from([0, 2, 3, 5, 7]);
        assert_eq!(each_once(&digests, &[0..3, 3..5, 5..8], &learned_from), ("a-b".into(), 3));
    }
}
