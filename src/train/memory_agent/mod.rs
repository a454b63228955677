//! Trains an agent with a memory: the detector first, then the choice among what it remembers.

mod chooser;
mod critic;
mod examples;
pub(crate) mod preset;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;
use tch::{Device, nn};

use self::chooser::ChooserLearning;
use self::critic::CriticLearning;
use self::examples::ExampleSets;
use self::preset::MemoryPreset;
use super::detection::DetectorLearning;
use super::frame_store::FrameStore;
use super::metrics::{JsonLinesLogger, ProgressLogger, Scalars};
use super::pretrain::Trained;
use super::pretrain::out_folder::TrainingFolder;
use super::stage::{Rhythm, Stage};
use super::tensorboard::TensorBoard;
use super::training_state::TrainingState;
use crate::agent::config::{AgentKind, CheckpointConfig, Ontology};
use crate::agent::memory_agent::config::{CriticProvenance, MemoryConfig, MemoryNetworks, MemoryProvenance};
use crate::agent::memory_agent::eyes::{Eyes, Sight};
use crate::data::dataset::Dataset;
use crate::nets::macro_critic::MacroCritic;
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
    /// A checkpoint whose detector and chooser are used, so that the critic alone is trained.
    pub(crate) chooser_from: Option<PathBuf>,
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
        let preset = &self.preset;
        let (chooser, critic) = (preset.chooser.spec(), preset.critic_spec());
        let networks = MemoryNetworks::new(&preset.detector, &chooser, critic.as_ref(), self.device);
        let data = digests.join("-");
        if !self.detector(&networks, (&frame_store, &data), &mut logger, stop)? {
            return Ok(Trained::Stopped);
        }
        let Some(sets) = self.examples(&networks, &frame_store, &mut logger, stop)? else {
            return Ok(Trained::Stopped);
        };
        let learned = Learned { networks: &networks, data: &data, sets: &sets };
        let trained = self.choice(&learned, &frame_store, &mut logger, stop)?;
        let Some(config) = trained else { return Ok(Trained::Stopped) };
        let finished = self.critic(&learned, config, &frame_store, &mut logger, stop)?;
        Ok(if finished { Trained::Finished } else { Trained::Stopped })
    }

    /// The chooser: another checkpoint's, or one that is trained now. What the checkpoint says of it; nothing when that was stopped.
    fn choice(
        &self,
        learned: &Learned<'_>,
        frame_store: &FrameStore,
        logger: &mut dyn ProgressLogger,
        stop: &AtomicBool,
    ) -> anyhow::Result<Option<MemoryConfig>> {
        let config = self.config(learned.data, frame_store)?;
        if let Some(folder) = &self.chooser_from {
            let given = MemoryConfig::read(folder)?;
            same_size(folder, "chooser", &given.chooser, &config.chooser)?;
            let networks = MemoryNetworks::load(folder, &given, self.device)?;
            let weights: weights::Tensors = networks.chooser_store.variables().into_iter().collect();
            weights::copy(&weights, "", &learned.networks.chooser_store)?;
            let provenance = MemoryProvenance { critic: None, ..given.provenance };
            return Ok(Some(MemoryConfig { provenance, ..config }));
        }
        let identity =
            self.identity(&[("dataset", learned.data), ("detector", &digest(&learned.networks.detector_store)?)]);
        let path = self.folder().training().join(STATES[1]);
        let state = TrainingState { path: &path, identity: &identity };
        let after = |steps: u64| {
            let provenance = MemoryProvenance { chooser_steps: steps, ..config.provenance.clone() };
            MemoryConfig { provenance, ..config.clone() }
        };
        let save = |steps: u64| learned.networks.save(&self.out, &after(steps));
        let stage = Stage { name: "chooser", rhythm: self.rhythm(), state, stop, save: &save };
        let learns = (&learned.networks.chooser_store, &learned.networks.chooser);
        let training = &self.preset.chooser_training;
        let finished =
            stage.run(&mut ChooserLearning::new(learns, learned.sets, training, self.preset.seed)?, logger)?;
        Ok(finished.then(|| after(self.preset.chooser_training.optimisation.steps)))
    }

    /// The critic, where the preset has one; false when its training was stopped.
    fn critic(
        &self,
        learned: &Learned<'_>,
        config: MemoryConfig,
        frame_store: &FrameStore,
        logger: &mut dyn ProgressLogger,
        stop: &AtomicBool,
    ) -> anyhow::Result<bool> {
        let (Some(critic), Some(spec)) = (&learned.networks.critic, self.preset.critic_spec()) else {
            learned.networks.save(&self.out, &config)?;
            return Ok(true);
        };
        let target_store = nn::VarStore::new(self.device);
        let target = MacroCritic::new(&target_store.root(), &spec);
        let [detector, chooser] = [&learned.networks.detector_store, &learned.networks.chooser_store].map(digest);
        let identity = self.identity(&[("dataset", learned.data), ("detector", &detector?), ("chooser", &chooser?)]);
        let path = self.folder().training().join(STATES[2]);
        let state = TrainingState { path: &path, identity: &identity };
        let trajectories = self.learned_from(frame_store);
        let save = |steps: u64| {
            let critic = CriticProvenance { dataset: learned.data.to_string(), trajectories, steps };
            let provenance = MemoryProvenance { critic: Some(critic), ..config.provenance.clone() };
            let advantage_scale = self.preset.advantage_scale;
            let config = MemoryConfig { provenance, critic: Some(spec.clone()), advantage_scale, ..config.clone() };
            learned.networks.save(&self.out, &config)
        };
        let stage = Stage { name: "critic", rhythm: self.rhythm(), state, stop, save: &save };
        let (online, target) = ((&learned.networks.critic_store, critic), (&target_store, &target));
        let training = &self.preset.critic_training;
        stage.run(&mut CriticLearning::new(online, target, learned.sets, training, self.preset.seed)?, logger)
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
        if let Some(folder) = self.detector_folder() {
            let config = MemoryConfig::read(folder)?;
            same_size(folder, "detector", &config.detector, &self.preset.detector)?;
            let given = MemoryNetworks::load(folder, &config, self.device)?;
            weights::copy(&given.detector_store.variables().into_iter().collect(), "", &networks.detector_store)?;
            return Ok(true);
        }
        let path = self.folder().training().join(STATES[0]);
        let identity = self.identity(&[("dataset", data)]);
        let state = TrainingState { path: &path, identity: &identity };
        let stage = Stage { name: "detector", rhythm: self.rhythm(), state, stop, save: &|_| Ok(()) };
        let learns = (&networks.detector_store, &networks.detector);
        let training = &self.preset.detector_training;
        stage.run(&mut DetectorLearning::new(learns, frame_store, training, stage.rhythm)?, logger)
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
        let (detector_dataset, detector_steps) = match (self.detector_folder(), preset.sight) {
            (_, Sight::Simulator) => (String::new(), 0),
            (Some(folder), _) => {
                let from = MemoryConfig::read(folder)?.provenance;
                (from.detector_dataset, from.detector_steps)
            }
            (None, _) => (data.to_string(), preset.detector_training.optimisation.steps),
        };
        Ok(MemoryConfig {
            format_version: CheckpointConfig::FORMAT,
            agent: AgentKind::Memory,
            ontology: Ontology::current(),
            sight: preset.sight,
            loop_guard: preset.loop_guard,
            detector: preset.detector.clone(),
            chooser: preset.chooser.spec(),
            critic: None,
            advantage_scale: 0.0,
            provenance: MemoryProvenance {
                preset: preset.name.clone(),
                detector_dataset,
                detector_steps,
                dataset: data.to_string(),
                trajectories: self.learned_from(frame_store),
                chooser_steps: 0,
                critic: None,
                seed: preset.seed,
            },
        })
    }

    /// How many trajectories are learned from.
    fn learned_from(&self, frame_store: &FrameStore) -> u64 {
        let apart = frame_store.kept_apart(self.preset.hold_out);
        self.drawn(frame_store).into_iter().filter(|&trajectory| !apart[trajectory]).count() as u64
    }

    fn detector_folder(&self) -> Option<&Path> {
        self.chooser_from.as_deref().or(self.detector_from.as_deref())
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

/// What the stages after the detector share.
struct Learned<'a> {
    networks: &'a MemoryNetworks,
    /// The digest of the datasets.
    data: &'a str,
    sets: &'a ExampleSets,
}

/// The digest of a network's weights, which later stages build on.
fn digest(store: &nn::VarStore) -> anyhow::Result<String> {
    weights::digest(store.variables())
}

fn same_size<T: PartialEq + Serialize>(folder: &Path, field: &str, found: &T, own: &T) -> anyhow::Result<()> {
    anyhow::ensure!(
        found == own,
        "{}: {field} is of another size than the preset's: {}",
        folder.join("config.json").display(),
        size_differences(found, own)
    );
    Ok(())
}

/// Trajectories that are replayed between two looks at whether to stop.
const CHUNK: usize = 200;
/// The states of the stages, in the folder of the training.
const STATES: [&str; 3] = ["detector.safetensors", "chooser.safetensors", "critic.safetensors"];
