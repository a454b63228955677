//! What a pretraining is asked for.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

use anyhow::Context;
use tch::Device;

use crate::agent::config::SentenceSpec;
use crate::agent::learned::SharedEmbedder;
use crate::agent::sentence_encoders;
use crate::nets::embedding_cache::Embedder;
use crate::nets::sentence::default_folder;
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
    /// Embeds the instructions, where the method reads sentences.
    pub(crate) sentences: Option<Sentences>,
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

    /// What checkpoints say of the sentence encoder.
    pub(super) fn sentence_spec(&self) -> Option<&SentenceSpec> {
        self.sentences.as_ref().map(|sentences| &sentences.spec)
    }

    pub(super) fn embedder(&self) -> anyhow::Result<MutexGuard<'_, Embedder>> {
        let sentences = self.sentences.as_ref().context("the method reads no sentences")?;
        sentences.embedder.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))
    }
}

/// A training's sentence encoder, and what its checkpoint says of it.
pub(crate) struct Sentences {
    pub(crate) embedder: SharedEmbedder,
    pub(crate) spec: SentenceSpec,
}

impl Sentences {
    /// Opens an encoder by its folder or name, or the one that set-up fetches.
    ///
    /// # Errors
    /// When it cannot be used.
    pub(crate) fn open(named: Option<&Path>, device: Device) -> anyhow::Result<Sentences> {
        let folder = named.map_or_else(default_folder, sentence_encoders::folder_of);
        let embedder = Embedder::open(&folder, device)?;
        let spec = sentence_encoders::spec_of(&folder, embedder.encoder().digest());
        Ok(Sentences { embedder: Arc::new(Mutex::new(embedder)), spec })
    }
}
