//! A trained agent: sees the last frames, reads the instruction, decides.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::{Arc, Mutex};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tch::{Device, Kind, Tensor};

use super::checkpoint::{Config, Networks};
use super::policy::{Decision, Policy, Situation};
use super::select::{self, Selection};
use crate::domain::ActionType;
use crate::language::instruction::normalise;
use crate::nets::embedding_cache::Embedder;

/// A sentence encoder with its cache, which several policies may share.
pub type SharedEmbedder = Arc<Mutex<Embedder>>;

/// A policy from a checkpoint.
pub struct LearnedPolicy {
    name: String,
    config: Config,
    networks: Networks,
    sentences: SharedEmbedder,
    device: Device,
    /// The maps of the last frames, oldest first, and the step that the last one belongs to.
    seen: VecDeque<Tensor>,
    seen_at: Option<u32>,
    /// The last image, and the actions that were chosen at it and left it as it was.
    last_image: Vec<u8>,
    blocked: Vec<ActionType>,
    last_choice: Option<ActionType>,
    /// The instruction that was read last, with its embedding.
    read: Option<(String, Tensor)>,
    samples: bool,
    rng: ChaCha8Rng,
}

impl LearnedPolicy {
    /// Loads a checkpoint; it decides greedily.
    ///
    /// # Errors
    /// When the checkpoint is malformed, or was trained with another sentence encoder.
    pub fn load(folder: &Path, sentences: SharedEmbedder, device: Device) -> anyhow::Result<LearnedPolicy> {
        let config = Config::read(folder)?;
        {
            let embedder = sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
            let encoder = embedder.encoder();
            let (wanted, found) = (config.policy.embedding, encoder.width() as i64);
            anyhow::ensure!(
                wanted == found,
                "{}: policy.embedding is {wanted}, the sentence encoder's width is {found}",
                folder.join("config.json").display()
            );
            let (wanted, found) = (&config.sentence_encoder.digest, encoder.digest());
            anyhow::ensure!(
                wanted == found,
                "{}: sentence_encoder.digest is {wanted}, the encoder at hand has {found}; use {}",
                folder.join("config.json").display(),
                config.sentence_encoder.name
            );
        }
        let networks = Networks::load(folder, &config, device)?;
        let name = folder.file_name().map_or_else(|| "agent".to_string(), |name| name.to_string_lossy().into_owned());
        Ok(LearnedPolicy::with(name, config, networks, sentences, device))
    }

    /// A policy of networks at hand.
    pub fn with(
        name: String,
        config: Config,
        networks: Networks,
        sentences: SharedEmbedder,
        device: Device,
    ) -> LearnedPolicy {
        LearnedPolicy {
            name,
            config,
            networks,
            sentences,
            device,
            seen: VecDeque::new(),
            seen_at: None,
            last_image: Vec::new(),
            blocked: Vec::new(),
            last_choice: None,
            read: None,
            samples: false,
            rng: ChaCha8Rng::seed_from_u64(0),
        }
    }

    /// The checkpoint's configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Whether it draws its actions by chance instead of taking the likeliest.
    pub fn set_sampling(&mut self, samples: bool) {
        self.samples = samples;
    }

    /// The last frames' maps as one observation. Before the first frames there was the first one.
    fn observe(&mut self, situation: &mut Situation<'_>) -> Tensor {
        let image = self.networks.visual.spec().image(situation.house.frame());
        self.notice(&image, self.seen_at != Some(situation.step));
        let map = self.networks.visual.encode(std::slice::from_ref(&image));
        self.last_image = image;
        let history = self.config.policy.history as usize;
        if self.seen_at == Some(situation.step) {
            self.seen.pop_back();
        }
        self.seen_at = Some(situation.step);
        self.seen.push_back(map);
        while self.seen.len() > history {
            self.seen.pop_front();
        }
        let first = history - self.seen.len();
        let maps: Vec<&Tensor> = (0..history).map(|i| &self.seen[i.saturating_sub(first)]).collect();
        Tensor::cat(&maps, 1)
    }

    /// Notices when the last choice changed nothing: a wall, or the camera's limit. Until the view changes it is not tried again.
    fn notice(&mut self, image: &[u8], stepped: bool) {
        if self.last_image != image {
            self.blocked.clear();
        } else if stepped && let Some(choice) = self.last_choice.filter(|choice| !choice.is_interaction()) {
            self.blocked.push(choice);
        }
    }

    fn sentence(&mut self, instruction: &str) -> anyhow::Result<Tensor> {
        if let Some((text, embedding)) = &self.read
            && text == instruction
        {
            return Ok(embedding.shallow_clone());
        }
        let mut embedder = self.sentences.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
        let embedding = embedder.embed(&[&normalise(instruction)])?.to_device(self.device).to_kind(Kind::Float);
        self.read = Some((instruction.to_string(), embedding.shallow_clone()));
        Ok(embedding)
    }
}

impl Policy for LearnedPolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn begin(&mut self, seed: u64) {
        self.seen.clear();
        self.last_image.clear();
        self.blocked.clear();
        self.last_choice = None;
        self.seen_at = None;
        self.rng = ChaCha8Rng::seed_from_u64(seed);
    }

    fn decide(&mut self, situation: &mut Situation<'_>) -> anyhow::Result<Decision> {
        let observation = self.observe(situation);
        let sentence = self.sentence(situation.instruction)?;
        let logits = tch::no_grad(|| self.networks.policy.forward(&observation, &sentence, false));
        let numbers = |tensor: Tensor| Vec::<f32>::try_from(tensor.flatten(0, -1).to_device(Device::Cpu));
        let (actions, objects) = (numbers(logits.actions)?, numbers(logits.objects)?);
        let candidates = situation.house.candidates();
        let selection = if self.samples { Selection::Sample(&mut self.rng) } else { Selection::Greedy };
        let decision = select::decide(&actions, &objects, &candidates, &self.blocked, selection);
        self.last_choice = Some(decision.action.kind);
        Ok(decision)
    }
}
