//! Pretraining: visual encoder, feature maps, sentences, policy; each stage can be stopped and taken up again.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use tch::{Device, Tensor};

use super::batches::Batches;
use super::encoding;
use super::events::Events;
use super::footage::Footage;
use super::material::{Embed, Maps, Material, Pool, Rows, Told, joined};
use super::presets::{Preset, Sight};
use super::progress::{Journal, Report, Scalars};
use super::trainer::Trainer;
use super::trials::{self, Trials};
use super::visual_training;
use crate::agent::checkpoint::Networks;
use crate::agent::config::{Config, Ontology, Provenance, SentenceSpec};
use crate::agent::learned::SharedEmbedder;
use crate::algo::chain::Pairs;
use crate::data::dataset::Dataset;
use crate::data::features::Features;
use crate::data::items::{Composites, Items, Source};
use crate::data::summaries::Summaries;
use crate::data::whole;
use crate::language::vocabulary::Vocabulary;
use crate::nets::eyes::Eyes;
use crate::nets::visual::VisualSpec;

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
    /// Tasks that the agent tries while it trains.
    pub trials: Option<Trials>,
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
    pub fn run(&self, report: &mut dyn Report, stop: &Arc<AtomicBool>) -> anyhow::Result<Trained> {
        let training = self.out.join("training");
        anyhow::ensure!(
            self.resume || !training.exists(),
            "{} holds a training already: use --resume, or another folder",
            self.out.display()
        );
        std::fs::create_dir_all(&training).with_context(|| format!("{} cannot be made", training.display()))?;
        self.keep_preset()?;
        let mut report = Journal::open(&training.join("progress.jsonl"), report)?;
        let mut report = Events::open(&training, &mut report)?;
        let datasets = self.data.iter().map(|folder| Dataset::open(folder)).collect::<anyhow::Result<Vec<_>>>()?;
        let footage = Footage::open(&datasets)?;
        tch::manual_seed(self.preset.seed as i64);
        let Preset { policy, critic, .. } = &self.preset;
        let networks = Networks::new(self.eyes()?, policy, critic.as_ref(), self.device);
        if !self.train_visual(&networks, &footage, &mut report, stop)? {
            return Ok(Trained::Stopped);
        }
        let digests = datasets.iter().map(Dataset::digest).collect::<anyhow::Result<Vec<_>>>()?;
        let digest = digests.join("-");
        if let Some(folder) = &self.policy_from {
            self.start_from(folder, &networks)?;
        }
        let encoder = networks.eyes.frozen()?;
        let Some(features) = encoding::features(&*encoder, &datasets, &footage, &mut report, stop)? else {
            return Ok(Trained::Stopped);
        };
        let summaries = self.summaries()?;
        let source = Source { trajectories: &footage.trajectories, held_out: &footage.held_out, summaries: &summaries };
        // A critic learns from what happened, a clone from what the expert would have done as well.
        let labels = if self.preset.iql.is_some() { footage.transitions()? } else { footage.labels()? };
        let items = Items::of(&source, labels, &self.preset.data, self.preset.hold_out)?;
        anyhow::ensure!(!items.training.is_empty(), "there is nothing to learn from: no span has a text");
        let words = self.preset.policy.attention.as_ref().map(|attention| {
            let texts = items.training.iter().map(|span| items.texts[span.text as usize].as_str());
            Vocabulary::of(texts, attention.words as usize)
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
        let config = |steps: u64| -> anyhow::Result<Config> {
            let config = self.config(&digest, learned_from.len() as u64, steps)?;
            let words = words.as_ref().map(|words| words.words().to_vec());
            Ok(Config { words, resnet18: resnet18.clone(), ..config })
        };
        let trainer = Trainer {
            networks: &networks,
            preset: &self.preset,
            state: &training.join("state.safetensors"),
            identity: &self.identity(encoder.digest(), &digest, &config(0)?),
        };
        let batches = Batches::new(
            material,
            self.preset.policy.history,
            networks.critic.is_some(),
            self.preset.chaining.as_ref(),
            (self.preset.seed, self.preset.training.batch),
            self.device,
        );
        let trials =
            self.trials.as_ref().map(|trials| Ok::<_, anyhow::Error>((trials, trials.prepare()?))).transpose()?;
        let mut saved: Option<u64> = None;
        let mut keep = |step, scalars: &mut Scalars| -> anyhow::Result<()> {
            networks.save(&self.out, &config(step)?)?;
            // A resumed training's first save comes `save_every` steps after the last one.
            let before = saved.replace(step).unwrap_or(step.saturating_sub(self.preset.save_every));
            match &trials {
                Some((trials, evaluation)) if trials.are_due(before, step) => {
                    trials::hold(evaluation, &self.out, &self.sentences, self.device, stop, scalars)
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
    ) -> anyhow::Result<Option<Material<'a>>> {
        let told = if self.preset.policy.goal.is_some() {
            Told::Goals
        } else if let Some(words) = words {
            Told::Words(items.texts.iter().map(|text| words.numbers(text)).collect())
        } else {
            let Some(sentences) = self.embed(&items.texts, report, stop)? else { return Ok(None) };
            Told::Sentences(Rows::new(&sentences, self.device)?)
        };
        let pool = match self.preset.chaining.as_ref().map(|chaining| chaining.pairs) {
            Some(Pairs::Pool(count)) => {
                let pairs = Pool::draw(items, self.preset.seed, count);
                let texts: Vec<String> = pairs.iter().map(|&pair| joined(items, pair)).collect();
                let Some(joint) = self.embed(&texts, report, stop)? else { return Ok(None) };
                Some(Pool::new(items, pairs, &joint, self.device)?)
            }
            _ => None,
        };
        Ok(Some(Material { items, maps: Maps::on(features, self.device), told, pool, embed }))
    }

    /// The labels of the datasets, where the preset asks for labels.
    fn summaries(&self) -> anyhow::Result<Summaries> {
        if self.preset.data.composites != Composites::Labels {
            return Ok(Summaries::default());
        }
        let folders: Vec<&Path> = self.data.iter().map(PathBuf::as_path).collect();
        Summaries::read(&folders, self.preset.data.labels_of.as_deref())
    }

    /// What a saved state belongs to.
    fn identity(&self, encoder: &str, data: &str, config: &Config) -> BTreeMap<String, String> {
        [
            ("format_version", "1".to_string()),
            ("dataset", data.to_string()),
            ("ontology", format!("{} {}", config.ontology.classes, config.ontology.actions.join(" "))),
            ("visual_encoder", encoder.to_string()),
            ("sentence_encoder", config.sentence_encoder.digest.clone()),
            ("embedding", config.policy.embedding.to_string()),
            ("seed", self.preset.seed.to_string()),
        ]
        .map(|(name, value)| (name.to_string(), value))
        .into()
    }

    /// Begins with a checkpoint's policy, and with its critic where both have one of the same size.
    fn start_from(&self, folder: &Path, networks: &Networks) -> anyhow::Result<()> {
        let (config, given) = self.given(folder)?;
        let file = folder.join("config.json");
        let (found, own) = (&config.policy, &self.preset.policy);
        anyhow::ensure!(found == own, "{}: policy is {found:?}, the preset's is {own:?}", file.display());
        let own = self.config("", 0, 0)?.sentence_encoder;
        let found = &config.sentence_encoder;
        anyhow::ensure!(
            found.digest == own.digest,
            "{}: sentence_encoder is {} ({}), this training's is {} ({})",
            file.display(),
            found.name,
            found.digest,
            own.name,
            own.digest
        );
        copy(&given.policy_store, "", &networks.policy_store)?;
        if config.critic == self.preset.critic
            && let (Some(given), Some(own)) = (&given.critic, &networks.critic)
        {
            copy(&given.online_store, "", &own.online_store)?;
        }
        Ok(())
    }

    /// A training goes on only with the preset it began with.
    fn keep_preset(&self) -> anyhow::Result<()> {
        let path = self.out.join("training/preset.toml");
        let text = toml::to_string(&self.preset)?;
        match std::fs::read_to_string(&path) {
            Ok(begun) if begun == text => Ok(()),
            Ok(_) => anyhow::bail!("{}: the training was begun with another preset", path.display()),
            Err(_) => whole::write(&path, text.as_bytes()),
        }
    }

    fn train_visual(
        &self,
        networks: &Networks,
        footage: &Footage,
        report: &mut dyn Report,
        stop: &AtomicBool,
    ) -> anyhow::Result<bool> {
        let Eyes::House { store: own, .. } = &networks.eyes else {
            anyhow::ensure!(
                self.visual_from.is_none(),
                "the preset's eyes are ResNet-18: there is no visual encoder to take"
            );
            return Ok(true);
        };
        if let Some(folder) = &self.visual_from {
            let given = self.given(folder)?.1.eyes;
            copy(given.store().context("its eyes are no House encoder")?, "", own)?;
            return Ok(true);
        }
        let state = self.out.join("training/visual.safetensors");
        // The heads live in a store of their own shape, so the trained encoder is copied out of it.
        let mut store = tch::nn::VarStore::new(self.device);
        let encoder = crate::nets::visual::VisualEncoder::new(&(store.root() / "encoder"), &self.preset.visual);
        let finished = visual_training::train(&store, &encoder, footage, &self.preset, &state, report, stop)?;
        store.freeze();
        copy(&store, "encoder.", own)?;
        Ok(finished)
    }

    /// What the agent will see through: a House encoder with fresh weights, or ResNet-18.
    fn eyes(&self) -> anyhow::Result<Eyes> {
        match self.preset.eyes {
            Sight::House => Ok(Eyes::house(&self.preset.visual, self.device)),
            Sight::ResNet18 => Eyes::resnet18(&Eyes::resnet18_file(), self.device),
        }
    }

    /// The House encoder's size, where there is one.
    fn visual(&self) -> Option<&VisualSpec> {
        (self.preset.eyes == Sight::House).then_some(&self.preset.visual)
    }

    /// A checkpoint whose visual encoder is of the preset's kind and size.
    fn given(&self, folder: &Path) -> anyhow::Result<(Config, Networks)> {
        let config = Config::read(folder)?;
        let file = folder.join("config.json");
        let (found, own) = (config.visual.as_ref(), self.visual());
        anyhow::ensure!(found == own, "{}: visual is {found:?}, the preset's is {own:?}", file.display());
        let networks = Networks::load(folder, &config, self.device)?;
        Ok((config, networks))
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
            self.preset.policy.embedding == embedder.encoder().width() as i64 || self.preset.policy.attention.is_some(),
            "the preset's policy.embedding is {}, the sentence encoder's width is {}",
            self.preset.policy.embedding,
            embedder.encoder().width()
        );
        Ok(Config {
            format_version: Config::FORMAT,
            ontology: Ontology::current(),
            visual: self.visual().cloned(),
            resnet18: None,
            method: Some(self.preset.method().to_string()),
            policy: self.preset.policy.clone(),
            critic: self.preset.critic.clone(),
            words: None,
            sentence_encoder: SentenceSpec {
                name: self.sentence_encoder.clone(),
                digest: embedder.encoder().digest().to_string(),
            },
            provenance: Provenance {
                preset: self.preset.name.clone(),
                dataset: dataset.to_string(),
                trajectories,
                seed: self.preset.seed,
                visual_steps: match (self.preset.eyes, &self.visual_from) {
                    (Sight::ResNet18, _) => 0,
                    (Sight::House, Some(folder)) => Config::read(folder)?.provenance.visual_steps,
                    (Sight::House, None) => self.preset.visual_training.optimisation.steps,
                },
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
