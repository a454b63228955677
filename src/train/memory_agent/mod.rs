//! Trains an agent with a memory: the detector first, then the choice among what it remembers.

mod chooser;
mod examples;
pub(crate) mod preset;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tch::Device;

use self::chooser::ExampleSets;
use self::preset::MemoryPreset;
use super::detection::{self, Rhythm};
use super::frame_store::FrameStore;
use super::metrics::{JsonLinesLogger, ProgressLogger, Scalars};
use super::pretrain::Trained;
use super::pretrain::out_folder::TrainingFolder;
use super::tensorboard::TensorBoard;
use super::training_state::TrainingState;
use crate::agent::config::{CheckpointConfig, Ontology};
use crate::agent::memory_agent::config::{AgentKind, MemoryConfig, MemoryNetworks, MemoryProvenance};
use crate::agent::memory_agent::eyes::{Eyes, Sight};
use crate::data::dataset::Dataset;
use crate::nets::size_differences::size_differences;
use crate::nets::weights;

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
    /// A checkpoint whose detector is used instead of training one.
    pub(crate) detector_from: Option<PathBuf>,
    /// Where to compute.
    pub(crate) device: Device,
}

impl MemoryTraining {
    /// Trains; each stage can be stopped, and taken up again where it was.
    ///
    /// # Errors
    /// When data or an earlier state cannot be read, the folder not be written, or `out` holds something else already.
    pub(crate) fn run(&self, logger: &mut dyn ProgressLogger, stop: &Arc<AtomicBool>) -> anyhow::Result<Trained> {
        let folder = self.folder();
        let has_state = folder.has_state()?;
        let datasets = self.data.iter().map(|folder| Dataset::open(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        let frame_store = FrameStore::open(&datasets)?;
        let digests = datasets.iter().map(Dataset::digest).collect::<anyhow::Result<Vec<_>>>()?;
        let _lock = folder.prepare(has_state, &toml::to_string(&self.preset)?, self.preset.format_version)?;
        let training = folder.training();
        let mut logger = JsonLinesLogger::open(&training.join("progress.jsonl"), logger)?;
        let mut logger = TensorBoard::open(&training, &mut logger)?;

        tch::manual_seed(self.preset.seed as i64);
        let networks = MemoryNetworks::new(&self.preset.detector, &self.preset.chooser.spec(), self.device);
        let data = digests.join("-");
        if !self.detector(&networks, (&frame_store, &data), &mut logger, stop)? {
            return Ok(Trained::Stopped);
        }
        let Some(sets) = self.examples(&networks, &frame_store, &mut logger, stop)? else {
            return Ok(Trained::Stopped);
        };
        let config = self.config(&data, &frame_store)?;
        let identity = self.identity(&[("dataset", &data), ("detector", &self.detector_digest(&networks)?)]);
        let path = training.join(STATES[1]);
        let state = TrainingState { path: &path, identity: &identity };
        let save = |steps: u64| {
            let provenance = MemoryProvenance { chooser_steps: steps, ..config.provenance.clone() };
            networks.save(&self.out, &MemoryConfig { provenance, ..config.clone() })
        };
        let how = (&self.preset.chooser_training, self.rhythm());
        let learns = (&networks.chooser_store, &networks.chooser);
        let finished = chooser::train(learns, &sets, how, state, &mut logger, stop, &save)?;
        Ok(if finished { Trained::Finished } else { Trained::Stopped })
    }

    /// The detector: another checkpoint's, or one that is trained now; false when that was stopped.
    fn detector(
        &self,
        networks: &MemoryNetworks,
        (frame_store, data): (&FrameStore, &str),
        logger: &mut dyn ProgressLogger,
        stop: &AtomicBool,
    ) -> anyhow::Result<bool> {
        if self.preset.sight == Sight::Simulator {
            return Ok(true);
        }
        if let Some(folder) = &self.detector_from {
            let config = MemoryConfig::read(folder)?;
            let (found, own) = (&config.detector, &self.preset.detector);
            let file = folder.join("config.json");
            anyhow::ensure!(
                found == own,
                "{}: detector is of another size than the preset's: {}",
                file.display(),
                size_differences(found, own)
            );
            let given = MemoryNetworks::load(folder, &config, self.device)?;
            weights::copy(&given.detector_store.variables().into_iter().collect(), "", &networks.detector_store)?;
            return Ok(true);
        }
        let path = self.folder().training().join(STATES[0]);
        let identity = self.identity(&[("dataset", data)]);
        let state = TrainingState { path: &path, identity: &identity };
        let how = (&self.preset.detector_training, self.rhythm());
        detection::train(&networks.detector_store, &networks.detector, frame_store, how, state, logger, stop)
    }

    /// What the chooser learns from; nothing when that was stopped.
    fn examples(
        &self,
        networks: &MemoryNetworks,
        frame_store: &FrameStore,
        logger: &mut dyn ProgressLogger,
        stop: &AtomicBool,
    ) -> anyhow::Result<Option<ExampleSets>> {
        let eyes = match self.preset.sight {
            Sight::Simulator => Eyes::Simulator,
            Sight::Detector => Eyes::Detector(Box::new(networks.detector.frozen())),
        };
        let apart = frame_store.kept_apart(self.preset.hold_out);
        let mut sets = ExampleSets { training: Vec::new(), held_out: Vec::new() };
        let all = self.drawn(frame_store);
        for (chunk, done) in all.chunks(CHUNK).zip(1u64..) {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let made = examples::examples(frame_store, &eyes, self.preset.seed, chunk)?;
            for (&trajectory, examples) in chunk.iter().zip(made) {
                let set = if apart[trajectory] { &mut sets.held_out } else { &mut sets.training };
                set.extend(examples);
            }
            let done = (done * CHUNK as u64).min(all.len() as u64);
            logger.log(&Scalars::new("examples", done, all.len() as u64))?;
        }
        Ok(Some(sets))
    }

    /// The trajectories that the chooser learns from: of each dataset as many, evenly spread.
    fn drawn(&self, frame_store: &FrameStore) -> Vec<usize> {
        let each = self.preset.chooser_training.trajectories.div_ceil(frame_store.parts.len().max(1)).max(1);
        let of = |part: &Range<usize>| -> Vec<usize> {
            let count = part.len().min(each);
            (0..count).map(|at| part.start + at * part.len() / count).collect()
        };
        frame_store.parts.iter().flat_map(of).collect()
    }

    fn config(&self, data: &str, frame_store: &FrameStore) -> anyhow::Result<MemoryConfig> {
        let preset = &self.preset;
        let (detector_dataset, detector_steps) = match (&self.detector_from, preset.sight) {
            (_, Sight::Simulator) => (String::new(), 0),
            (Some(folder), _) => {
                let from = MemoryConfig::read(folder)?.provenance;
                (from.detector_dataset, from.detector_steps)
            }
            (None, _) => (data.to_string(), preset.detector_training.optimisation.steps),
        };
        let apart = frame_store.kept_apart(preset.hold_out);
        let learned_from = self.drawn(frame_store).into_iter().filter(|&trajectory| !apart[trajectory]).count();
        Ok(MemoryConfig {
            format_version: CheckpointConfig::FORMAT,
            agent: AgentKind::Memory,
            ontology: Ontology::current(),
            sight: preset.sight,
            loop_guard: preset.loop_guard,
            detector: preset.detector.clone(),
            chooser: preset.chooser.spec(),
            provenance: MemoryProvenance {
                preset: preset.name.clone(),
                detector_dataset,
                detector_steps,
                dataset: data.to_string(),
                trajectories: learned_from as u64,
                chooser_steps: 0,
                seed: preset.seed,
            },
        })
    }

    fn detector_digest(&self, networks: &MemoryNetworks) -> anyhow::Result<String> {
        weights::digest(networks.detector_store.variables())
    }

    fn identity(&self, parts: &[(&str, &str)]) -> BTreeMap<String, String> {
        let own = [("format_version", "1".to_string()), ("seed", self.preset.seed.to_string())];
        let parts = parts.iter().map(|(name, value)| (*name, (*value).to_string()));
        own.into_iter().chain(parts).map(|(name, value)| (name.to_string(), value)).collect()
    }

    fn rhythm(&self) -> Rhythm {
        let MemoryPreset { seed, hold_out, save_every, report_every, .. } = self.preset;
        Rhythm { seed, hold_out, save_every, report_every }
    }

    fn folder(&self) -> TrainingFolder<'_> {
        TrainingFolder { out: &self.out, states: &STATES, resume: self.resume }
    }
}

/// Trajectories that are replayed between two looks at whether to stop.
const CHUNK: usize = 200;
/// The states of the stages, in the folder of the training.
const STATES: [&str; 2] = ["detector.safetensors", "chooser.safetensors"];
