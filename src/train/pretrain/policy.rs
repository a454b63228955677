//! The policy stage: policy and critic learn, a checkpoint is saved on the way, and the agent plays some tasks for its curve.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::checkpoint_config::{after, checkpoint_config, identity};
use super::demonstrations::Demonstrations;
use super::spec::Pretraining;
use super::text_embeddings::Texts;
use crate::agent::checkpoint::Networks;
use crate::data::features::Features;
use crate::data::items::Items;
use crate::eval::evaluation::Evaluation;
use crate::train::batch_sampler::BatchSampler;
use crate::train::in_training_eval;
use crate::train::metrics::{ProgressLogger, Scalars};
use crate::train::trainer::Trainer;
use crate::train::training_data::{FeatureMaps, TrainingData};
use crate::train::training_state::TrainingState;

/// What the earlier stages gave.
pub(super) struct Inputs<'a> {
    pub(crate) demonstrations: &'a Demonstrations,
    pub(crate) networks: &'a Networks,
    pub(crate) features: &'a Features,
    pub(crate) items: &'a Items,
    pub(crate) texts: Texts,
    /// The tasks that the agent plays on the way.
    pub(crate) evaluation: Option<Evaluation>,
}

/// Trains policy and critic; false when it was stopped.
pub(super) fn train(
    spec: &Pretraining,
    inputs: Inputs<'_>,
    logger: &mut dyn ProgressLogger,
    stop: &Arc<AtomicBool>,
) -> anyhow::Result<bool> {
    let Inputs { demonstrations, networks, features, items, texts, evaluation } = inputs;
    let config = checkpoint_config(spec, demonstrations, &networks.visual_encoder, items, &texts)?;
    let encoder = networks.visual_encoder.frozen()?;
    let path = spec.training_folder().join("state.safetensors");
    let identity = identity(spec, &demonstrations.digest(), encoder.digest(), items, &config);
    let trainer = Trainer { networks, preset: &spec.preset, state: TrainingState { path: &path, identity: &identity } };
    let embed = |texts: &[&str]| spec.embedder()?.encoder().encode(texts);
    let data = TrainingData {
        items,
        feature_maps: FeatureMaps::on(features, spec.device),
        conditioning: texts.conditioning,
        pool: texts.pool,
        embed: &embed,
    };
    let batches = BatchSampler::new(
        data,
        spec.preset.policy.history,
        networks.critic.is_some(),
        spec.preset.chaining.as_ref(),
        (spec.preset.seed, spec.preset.training.batch_size),
        spec.device,
    );
    let mut saved: Option<u64> = None;
    let mut save_checkpoint = |step, scalars: &mut Scalars| -> anyhow::Result<()> {
        networks.save(&spec.out, &after(step, &config))?;
        // A resumed training's first save comes `save_every` steps after the last one.
        let before = saved.replace(step).unwrap_or(step.saturating_sub(spec.preset.save_every));
        match spec.in_training_eval.as_ref().zip(evaluation.as_ref()) {
            Some((settings, evaluation)) if settings.is_due(before, step) => {
                let embedder = spec.sentences.as_ref().map(|sentences| &sentences.embedder);
                in_training_eval::run(evaluation, &spec.out, embedder, spec.device, stop, scalars)
            }
            _ => Ok(()),
        }
    };
    trainer.train(batches, &items.held_out, logger, stop, &mut save_checkpoint)
}
