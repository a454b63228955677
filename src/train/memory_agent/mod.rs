//! Trains an agent with a memory: the detector first, then the choice among what it remembers.

pub(crate) mod preset;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use tch::{Device, nn};

use self::preset::MemoryPreset;
use super::detection;
use super::frame_store::FrameStore;
use super::metrics::{JsonLinesLogger, ProgressLogger};
use super::pretrain::{Trained, out_folder};
use super::tensorboard::TensorBoard;
use super::training_state::TrainingState;
use crate::data::dataset::Dataset;
use crate::nets::detector::Detector;

/// What to train, on what, into where.
pub(crate) struct MemoryTraining {
    /// The hyper-parameters.
    pub(crate) preset: MemoryPreset,
    /// The datasets' folders.
    pub(crate) data: Vec<PathBuf>,
    /// The checkpoint's folder.
    pub(crate) out: PathBuf,
    /// Go on with the training that was begun in `out`.
    pub(crate) resume: bool,
    /// Where to compute.
    pub(crate) device: Device,
}

impl MemoryTraining {
    /// Trains; each stage can be stopped, and taken up again where it was.
    ///
    /// # Errors
    /// When data or an earlier state cannot be read, the folder not be written, or `out` holds something else already.
    pub(crate) fn run(&self, logger: &mut dyn ProgressLogger, stop: &Arc<AtomicBool>) -> anyhow::Result<Trained> {
        let folder = out_folder::TrainingFolder { out: &self.out, states: &STATES, resume: self.resume };
        let has_state = folder.has_state()?;
        let datasets = self.data.iter().map(|folder| Dataset::open(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        let frame_store = FrameStore::open(&datasets)?;
        let digests = datasets.iter().map(Dataset::digest).collect::<anyhow::Result<Vec<_>>>()?;
        folder.prepare(has_state, &toml::to_string(&self.preset)?, self.preset.format_version)?;
        let training = folder.training();
        let mut logger = JsonLinesLogger::open(&training.join("progress.jsonl"), logger)?;
        let mut logger = TensorBoard::open(&training, &mut logger)?;

        tch::manual_seed(self.preset.seed as i64);
        let store = nn::VarStore::new(self.device);
        let detector = Detector::new(&store.root(), &self.preset.detector);
        let identity: BTreeMap<String, String> = [
            ("format_version".to_string(), "1".to_string()),
            ("dataset".to_string(), digests.join("-")),
            ("seed".to_string(), self.preset.seed.to_string()),
        ]
        .into();
        let path = training.join(STATES[0]);
        let state = TrainingState { path: &path, identity: &identity };
        let rhythm = detection::Rhythm {
            seed: self.preset.seed,
            hold_out: self.preset.hold_out,
            save_every: self.preset.save_every,
            report_every: self.preset.report_every,
        };
        let trained = &self.preset.detector_training;
        let detected = detection::train(&store, &detector, &frame_store, (trained, rhythm), state, &mut logger, stop)?;
        if !detected {
            return Ok(Trained::Stopped);
        }
        Ok(Trained::Finished)
    }
}

/// The states of the stages, in the folder of the training.
const STATES: [&str; 2] = ["detector.safetensors", "chooser.safetensors"];
