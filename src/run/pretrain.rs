//! Pretraining: visual encoder, feature maps, sentences, policy; each stage can be stopped and taken up again.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use tch::{Device, Tensor};

use super::cloning::{self, Material};
use super::encoding;
use super::footage::Footage;
use super::presets::Preset;
use super::progress::{Journal, Report, Scalars};
use super::visual_training;
use crate::agent::checkpoint::{Config, Networks, Ontology, Provenance, SentenceSpec};
use crate::agent::learned::SharedEmbedder;
use crate::data::dataset::Dataset;
use crate::data::items::{Composites, Items, Selection, Source};
use crate::data::summaries::Summaries;

/// What to train, on what, into where.
pub struct Pretraining {
    /// The hyper-parameters.
    pub preset: Preset,
    /// The datasets' folders; each keeps its own cache.
    pub data: Vec<PathBuf>,
    /// The checkpoint's folder.
    pub out: PathBuf,
    /// Take up the training that was begun in `out`.
    pub resume: bool,
    /// A checkpoint whose visual encoder is used instead of training one.
    pub visual_from: Option<PathBuf>,
    /// A checkpoint whose policy is the start, instead of a fresh one.
    pub policy_from: Option<PathBuf>,
    /// Embeds the instructions.
    pub sentences: SharedEmbedder,
    /// The name of the sentence encoder's folder.
    pub sentence_encoder: String,
    /// Where to compute.
    pub device: Device,
}

/// How a training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trained {
    /// All steps were taken.
    Finished,
    /// It was stopped, and can be resumed.
    Stopped,
}

/// Texts that are embedded at once.
const TEXTS: usize = 256;

impl Pretraining {
    /// Trains; the checkpoint in `out` is complete whenever this returns `Finished`, and a working one from the first saved step of the
    /// policy on.
    ///
    /// # Errors
    /// When data or an earlier state cannot be read, the folder not be written, or there is a training in `out` already.
    pub fn run(&self, report: &mut dyn Report, stop: &AtomicBool) -> anyhow::Result<Trained> {
        let training = self.out.join("training");
        anyhow::ensure!(
            self.resume || !training.exists(),
            "{} holds a training already: use --resume, or another folder",
            self.out.display()
        );
        std::fs::create_dir_all(&training).with_context(|| format!("{} cannot be made", training.display()))?;
        self.keep_preset()?;
        let mut report = Journal::open(&training.join("progress.jsonl"), report)?;
        let datasets = self.data.iter().map(|folder| Dataset::open(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        let footage = Footage::open(&datasets)?;
        tch::manual_seed(self.preset.seed as i64);
        let networks = Networks::new(&self.preset.visual, &self.preset.policy, self.device);
        if !self.train_visual(&networks, &footage, &mut report, stop)? {
            return Ok(Trained::Stopped);
        }
        let digests = datasets.iter().map(Dataset::digest).collect::<anyhow::Result<Vec<_>>>()?;
        let digest = digests.join("-");
        if let Some(folder) = &self.policy_from {
            copy(&self.given(folder)?.policy_store, "", &networks.policy_store)?;
        }
        let encoder = networks.visual.frozen(&networks.visual_store)?;
        let Some(features) = encoding::features(&encoder, &datasets, &footage, &mut report, stop)? else {
            return Ok(Trained::Stopped);
        };
        let selection = Selection::of(Composites::Whole);
        let summaries = Summaries::default();
        let source = Source { trajectories: &footage.trajectories, held_out: &footage.held_out, summaries: &summaries };
        let items = Items::of(&source, footage.labels()?, &selection, self.preset.hold_out)?;
        let Some(sentences) = self.embed(&items.texts, &mut report, stop)? else { return Ok(Trained::Stopped) };
        let material = Material { items: &items, features: &features, sentences: &sentences };
        let config = |steps: u64| self.config(&digest, footage.trajectories.len() as u64, steps);
        let finished = cloning::train(
            (&networks.policy_store, &networks.policy),
            &material,
            &self.preset,
            &training.join("policy.safetensors"),
            &mut report,
            stop,
            &mut |steps| networks.save(&self.out, &config(steps)?),
        )?;
        Ok(if finished { Trained::Finished } else { Trained::Stopped })
    }

    /// A training goes on only with the preset it began with.
    fn keep_preset(&self) -> anyhow::Result<()> {
        let path = self.out.join("training/preset.toml");
        let text = toml::to_string(&self.preset)?;
        match std::fs::read_to_string(&path) {
            Ok(begun) if begun == text => Ok(()),
            Ok(_) => anyhow::bail!("{}: the training was begun with another preset", path.display()),
            Err(_) => crate::agent::checkpoint::write_whole(&path, text.as_bytes()),
        }
    }

    fn train_visual(
        &self,
        networks: &Networks,
        footage: &Footage,
        report: &mut dyn Report,
        stop: &AtomicBool,
    ) -> anyhow::Result<bool> {
        let state = self.out.join("training/visual.safetensors");
        if let Some(folder) = &self.visual_from {
            copy(&self.given(folder)?.visual_store, "", &networks.visual_store)?;
            return Ok(true);
        }
        // The heads live in a store of their own shape, so the trained encoder is copied out of it.
        let mut store = tch::nn::VarStore::new(self.device);
        let encoder = crate::nets::visual::VisualEncoder::new(&(store.root() / "encoder"), &self.preset.visual);
        let finished = visual_training::train(&store, &encoder, footage, &self.preset, &state, report, stop)?;
        store.freeze();
        copy(&store, "encoder.", &networks.visual_store)?;
        Ok(finished)
    }

    /// The networks of a checkpoint of the preset's sizes.
    fn given(&self, folder: &Path) -> anyhow::Result<Networks> {
        let config = Config::read(folder)?;
        let file = folder.join("config.json");
        let (found, own) = (&config.visual, &self.preset.visual);
        anyhow::ensure!(found == own, "{}: visual is {found:?}, the preset's is {own:?}", file.display());
        let (found, own) = (&config.policy, &self.preset.policy);
        anyhow::ensure!(found == own, "{}: policy is {found:?}, the preset's is {own:?}", file.display());
        Networks::load(folder, &config, self.device)
    }

    fn embed(&self, texts: &[String], report: &mut dyn Report, stop: &AtomicBool) -> anyhow::Result<Option<Tensor>> {
        let mut rows = Vec::new();
        let mut embedder = self.sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
        for (i, chunk) in texts.chunks(TEXTS).enumerate() {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let chunk: Vec<&str> = chunk.iter().map(String::as_str).collect();
            rows.push(embedder.embed(&chunk)?.to_device(Device::Cpu));
            report.step(&Scalars::new("sentences", (i * TEXTS + chunk.len()) as u64, texts.len() as u64))?;
        }
        anyhow::ensure!(!rows.is_empty(), "no trajectory has an annotation");
        Ok(Some(Tensor::cat(&rows, 0)))
    }

    fn config(&self, dataset: &str, trajectories: u64, policy_steps: u64) -> anyhow::Result<Config> {
        let embedder = self.sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
        anyhow::ensure!(
            self.preset.policy.embedding == embedder.encoder().width() as i64,
            "the preset's policy.embedding is {}, the sentence encoder's width is {}",
            self.preset.policy.embedding,
            embedder.encoder().width()
        );
        Ok(Config {
            format_version: Config::FORMAT,
            ontology: Ontology::current(),
            visual: self.preset.visual.clone(),
            policy: self.preset.policy.clone(),
            sentence_encoder: SentenceSpec {
                name: self.sentence_encoder.clone(),
                digest: embedder.encoder().digest().to_string(),
            },
            provenance: Provenance {
                preset: self.preset.name.clone(),
                dataset: dataset.to_string(),
                trajectories,
                seed: self.preset.seed,
                visual_steps: self.preset.visual_training.optimisation.steps,
                policy_steps,
            },
        })
    }
}

/// Copies the tensors of one store, those under `prefix`, over another's.
fn copy(from: &tch::nn::VarStore, prefix: &str, to: &tch::nn::VarStore) -> anyhow::Result<()> {
    let from = from.variables();
    tch::no_grad(|| {
        for (name, mut tensor) in to.variables() {
            let name = format!("{prefix}{name}");
            tensor.f_copy_(from.get(&name).with_context(|| format!("the tensor {name} is missing"))?)?;
        }
        Ok(())
    })
}
