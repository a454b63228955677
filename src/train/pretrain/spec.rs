//! What a pretraining is asked for.

use std::path::PathBuf;
use std::sync::MutexGuard;

use tch::Device;

use crate::agent::learned::SharedEmbedder;
use crate::nets::embedding_cache::Embedder;
use crate::nets::visual::VisualSpec;
use crate::train::in_training_eval::InTrainingEval;
use crate::train::preset::{Preset, VisualBackbone};

/// What to train, on what, into where.
pub(crate) struct Pretraining {
    /// The hyper-parameters.
    pub(crate) preset: Preset,
    /// The datasets' folders; each keeps its own feature cache.
    pub(crate) data: Vec<PathBuf>,
    /// The checkpoint's folder.
    pub(crate) out: PathBuf,
    /// Go on with the training that was begun in `out`.
    pub(crate) resume: bool,
    /// A checkpoint whose visual encoder is used instead of training one.
    pub(crate) visual_from: Option<PathBuf>,
    /// A checkpoint whose policy is the start, instead of a fresh one.
    pub(crate) policy_from: Option<PathBuf>,
    /// A checkpoint whose critic is the start, instead of a fresh one.
    pub(crate) critic_from: Option<PathBuf>,
    /// Tasks that the agent plays while it trains.
    pub(crate) in_training_eval: Option<InTrainingEval>,
    /// Embeds the instructions.
    pub(crate) embedder: SharedEmbedder,
    /// The name of the sentence encoder's folder.
    pub(crate) sentence_encoder: String,
    /// Where to compute.
    pub(crate) device: Device,
}

impl Pretraining {
    /// The folder beside the checkpoint with the training's states and curves.
    pub(super) fn training_folder(&self) -> PathBuf {
        self.out.join("training")
    }

    /// The House encoder's size; nothing for ResNet-18.
    pub(super) fn visual_spec(&self) -> Option<&VisualSpec> {
        (self.preset.visual_backbone == VisualBackbone::House).then_some(&self.preset.visual_encoder)
    }

    pub(super) fn embedder(&self) -> anyhow::Result<MutexGuard<'_, Embedder>> {
        self.embedder.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))
    }
}
