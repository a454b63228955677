//! Pretraining, in the paper's order (section 4): visual encoder, feature maps, items with their texts, policy and critic. Each
//! stage can be stopped, and taken up again where it was.

mod checkpoint_config;
mod demonstrations;
mod initial_networks;
pub(crate) mod out_folder;
mod policy;
mod spec;
mod text_embeddings;
mod visual_encoder;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use self::demonstrations::Demonstrations;
use self::initial_networks::initial_networks;
use self::out_folder::TrainingFolder;
use self::policy::Inputs;
pub(crate) use self::spec::{Pretraining, Sentences};
use self::text_embeddings::embed_texts;
use super::feature_cache;
use super::in_training_eval::InTrainingEval;
use super::metrics::{JsonLinesLogger, ProgressLogger};
use super::tensorboard::TensorBoard;

/// How a training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trained {
    /// All steps were taken.
    Finished,
    /// It was stopped, and can be resumed.
    Stopped,
}

/// The states of the stages, in the folder of the training.
const STATES: [&str; 2] = ["visual.safetensors", "state.safetensors"];

impl Pretraining {
    /// Trains; the checkpoint in `out` is complete whenever this returns `Finished`, and a working one from the first saved step of the
    /// policy on.
    ///
    /// # Errors
    /// When data or an earlier state cannot be read, the folder not be written, or `out` holds something else already.
    pub(crate) fn run(&self, logger: &mut dyn ProgressLogger, stop: &Arc<AtomicBool>) -> anyhow::Result<Trained> {
        // What can be refused is refused before the folder is touched.
        let folder = TrainingFolder { out: &self.out, states: &STATES, resume: self.resume };
        let has_state = folder.has_state()?;
        let demonstrations = Demonstrations::open(self)?;
        let networks = initial_networks(self)?;
        let evaluation = self.in_training_eval.as_ref().map(InTrainingEval::prepare).transpose()?;
        let _lock = folder.prepare(has_state, &toml::to_string(&self.preset)?, self.preset.format_version)?;
        let mut logger = JsonLinesLogger::open(&self.training_folder().join("progress.jsonl"), logger)?;
        let mut logger = TensorBoard::open(&self.training_folder(), &mut logger)?;

        if !visual_encoder::train(self, &demonstrations, &networks.visual_encoder, &mut logger, stop)? {
            return Ok(Trained::Stopped);
        }
        let encoder = networks.visual_encoder.frozen()?;
        let Demonstrations { datasets, frame_store, .. } = &demonstrations;
        let Some(features) = feature_cache::features(&*encoder, datasets, frame_store, &mut logger, stop)? else {
            return Ok(Trained::Stopped);
        };
        let items = demonstrations.items(self)?;
        let Some(texts) = embed_texts(self, (&items, frame_store), &mut logger, stop)? else {
            return Ok(Trained::Stopped);
        };
        let (demonstrations, networks, features, items) = (&demonstrations, &networks, &features, &items);
        let inputs = Inputs { demonstrations, networks, features, items, texts, evaluation };
        Ok(if policy::train(self, inputs, &mut logger, stop)? { Trained::Finished } else { Trained::Stopped })
    }
}
