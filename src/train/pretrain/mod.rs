//! Pretraining: visual encoder, feature maps, sentences, policy; each stage can be stopped and taken up again.

mod beginning;
mod description;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use tch::{Device, Tensor};

use super::batches::Batches;
use super::feature_cache;
use super::frame_store::FrameStore;
use super::in_training_eval;
use super::in_training_eval::InTrainingEval;
use super::metrics::{Journal, Report, Scalars};
use super::preset::Preset;
use super::tensorboard::TensorBoard;
use super::trainer::Trainer;
use super::training_data::{ConditioningTable, Embed, Maps, Pool, Rows, TrainingData, joined};
use super::training_state::TrainingState;
use crate::agent::config::Config;
use crate::agent::learned::SharedEmbedder;
use crate::agent::logit_adjustment::LogitAdjustment;
use crate::algo::chain::PairSource;
use crate::data::dataset::Dataset;
use crate::data::features::Features;
use crate::data::items::{ItemSource, Items};
use crate::data::selection::Composites;
use crate::data::summaries::Summaries;
use crate::language::vocabulary::Vocabulary;

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
    /// A checkpoint whose critic is the start, instead of a fresh one.
    pub critic_from: Option<PathBuf>,
    /// Tasks that the agent tries while it trains.
    pub trials: Option<InTrainingEval>,
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
    /// When data or an earlier state cannot be read, the folder not be written, or `out` holds something else already.
    pub fn run(&self, report: &mut dyn Report, stop: &Arc<AtomicBool>) -> anyhow::Result<Trained> {
        let training = self.out.join("training");
        let begun = self.check_out(&training)?;
        // What can be refused is refused before the folder is touched.
        let datasets = self.data.iter().map(|folder| Dataset::open(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        let frame_store = FrameStore::open(&datasets)?;
        let networks = self.networks()?;
        let trials =
            self.trials.as_ref().map(|trials| Ok::<_, anyhow::Error>((trials, trials.prepare()?))).transpose()?;
        std::fs::create_dir_all(&training).with_context(|| format!("{} cannot be made", training.display()))?;
        if !begun {
            Pretraining::take_back(&training)?;
        }
        self.keep_preset()?;
        let mut report = Journal::open(&training.join("progress.jsonl"), report)?;
        let mut report = TensorBoard::open(&training, &mut report)?;
        let digests = datasets.iter().map(Dataset::digest).collect::<anyhow::Result<Vec<_>>>()?;
        let digest = digests.join("-");
        if !self.train_visual(&networks, (&frame_store, &digest), &mut report, stop)? {
            return Ok(Trained::Stopped);
        }
        let encoder = networks.eyes.frozen()?;
        let Some(features) = feature_cache::features(&*encoder, &datasets, &frame_store, &mut report, stop)? else {
            return Ok(Trained::Stopped);
        };
        let summaries = self.summaries()?;
        let source = ItemSource {
            trajectories: &frame_store.trajectories,
            apart: &frame_store.kept_apart(self.preset.hold_out),
            held_out: &frame_store.held_out,
            summaries: &summaries,
        };
        let items = Items::of(&source, frame_store.labels()?, &self.preset.data)?;
        anyhow::ensure!(
            !items.training.is_empty(),
            "there is nothing to learn from: no span has a text, or every one is held out (hold_out is {})",
            self.preset.hold_out
        );
        let words = self.preset.policy.attention.as_ref().map(|attention| {
            let texts = items.training.iter().map(|span| items.texts[span.text as usize].as_str());
            Vocabulary::of(texts, attention.words)
        });
        let embed = |texts: &[&str]| -> anyhow::Result<Tensor> {
            let embedder = self.sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
            embedder.encoder().encode(texts)
        };
        let Some(material) = self.material(&items, &features, &embed, words.as_ref(), &mut report, stop)? else {
            return Ok(Trained::Stopped);
        };
        let resnet18 = networks.eyes.store().is_none().then(|| encoder.digest().to_owned());
        let learned_from: BTreeSet<u32> = items.training.iter().map(|span| span.trajectory).collect();
        let (dataset, trajectories) = description::each_once(&digests, &frame_store.parts, &learned_from);
        let logit_adjustment =
            LogitAdjustment { strength: self.preset.logit_adjustment, shares: items.action_shares() };
        let config = |steps: u64| -> anyhow::Result<Config> {
            let config = self.config(&dataset, trajectories, steps)?;
            let words = words.as_ref().map(|words| words.words().to_vec());
            Ok(Config { words, resnet18: resnet18.clone(), logit_adjustment: Some(logit_adjustment.clone()), ..config })
        };
        let path = training.join("state.safetensors");
        let identity = self.identity(encoder.digest(), &digest, &items.digest(), &config(0)?);
        let trainer = Trainer {
            networks: &networks,
            preset: &self.preset,
            state: TrainingState { path: &path, identity: &identity },
        };
        let batches = Batches::new(
            material,
            self.preset.policy.history,
            networks.critic.is_some(),
            self.preset.chaining.as_ref(),
            (self.preset.seed, self.preset.training.batch),
            self.device,
        );
        let mut saved: Option<u64> = None;
        let mut keep = |step, scalars: &mut Scalars| -> anyhow::Result<()> {
            networks.save(&self.out, &config(step)?)?;
            // A resumed training's first save comes `save_every` steps after the last one.
            let before = saved.replace(step).unwrap_or(step.saturating_sub(self.preset.save_every));
            match &trials {
                Some((trials, evaluation)) if trials.are_due(before, step) => {
                    in_training_eval::hold(evaluation, &self.out, &self.sentences, self.device, stop, scalars)
                }
                _ => Ok(()),
            }
        };
        let finished = trainer.train(batches, &items.held_out, &mut report, stop, &mut keep)?;
        Ok(if finished { Trained::Finished } else { Trained::Stopped })
    }

    /// Everything that batches are made of; nothing when it was stopped meanwhile.
    fn material<'a>(
        &self,
        items: &'a Items,
        features: &'a Features,
        embed: &'a Embed<'a>,
        words: Option<&Vocabulary>,
        report: &mut dyn Report,
        stop: &AtomicBool,
    ) -> anyhow::Result<Option<TrainingData<'a>>> {
        let told = if self.preset.policy.goal.is_some() {
            ConditioningTable::Goals
        } else if let Some(words) = words {
            ConditioningTable::Words(items.texts.iter().map(|text| words.numbers(text)).collect())
        } else {
            let Some(sentences) = self.embed(&items.texts, report, stop)? else { return Ok(None) };
            ConditioningTable::Sentences(Rows::new(&sentences, self.device)?)
        };
        let pool = match self.preset.chaining.as_ref().map(|chaining| chaining.pairs) {
            Some(PairSource::Pool(count)) => {
                let pairs = Pool::draw(items, self.preset.seed, count);
                let texts: Vec<String> = pairs.iter().map(|&pair| joined(items, pair)).collect();
                let Some(joint) = self.embed(&texts, report, stop)? else { return Ok(None) };
                Some(Pool::new(items, pairs, &joint, self.device)?)
            }
            _ => None,
        };
        Ok(Some(TrainingData { items, maps: Maps::on(features, self.device), told, pool, embed }))
    }

    /// The labels of the datasets, where the preset asks for labels.
    fn summaries(&self) -> anyhow::Result<Summaries> {
        if self.preset.data.composites != Composites::Labels {
            return Ok(Summaries::default());
        }
        let folders: Vec<&Path> = self.data.iter().map(PathBuf::as_path).collect();
        Summaries::read(&folders, self.preset.data.labels_of.as_deref())
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
}
