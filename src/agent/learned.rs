//! A trained agent: sees the last frames, reads the instruction, decides.

use std::path::Path;

use tch::{Device, Tensor};

use super::checkpoint::{Config, Networks};
use super::memory::Memory;
pub use super::memory::SharedEmbedder;
use super::policy::{Carried, Decision, Policy, Reading, Situation};
use crate::language::instruction::normalise;

/// A policy from a checkpoint.
pub struct LearnedPolicy {
    pub(super) name: String,
    pub(super) config: Config,
    pub(super) networks: Networks,
    pub(super) sentences: SharedEmbedder,
    pub(super) device: Device,
    pub(super) samples: bool,
    pub(super) memory: Memory,
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
        LearnedPolicy { name, config, networks, sentences, device, samples: false, memory: Memory::default() }
    }

    /// The checkpoint's configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Whether it draws its actions by chance instead of taking the likeliest.
    pub fn set_sampling(&mut self, samples: bool) {
        self.samples = samples;
    }

    /// The last frames' maps as one observation.
    fn observe(&mut self, situation: &mut Situation<'_>) -> Tensor {
        let image = self.networks.visual.spec().image(situation.house.frame());
        self.memory.look(&image, situation.step);
        let map = self.networks.visual.encode(std::slice::from_ref(&image));
        self.memory.observe(map, situation.step, self.config.policy.history as usize)
    }
}

impl Policy for LearnedPolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn begin(&mut self, seed: u64) {
        self.memory.begin(seed);
    }

    fn decide(&mut self, situation: &mut Situation<'_>) -> anyhow::Result<Decision> {
        let observation = self.observe(situation);
        let sentence = self.memory.sentence(situation.instruction, &self.sentences, self.device)?;
        let logits = tch::no_grad(|| self.networks.policy.forward(&observation, &sentence, false));
        let numbers = |tensor: Tensor| Vec::<f32>::try_from(tensor.flatten(0, -1).to_device(Device::Cpu));
        let (actions, objects) = (numbers(logits.actions)?, numbers(logits.objects)?);
        Ok(self.memory.decide(&actions, &objects, &situation.house.candidates(), self.samples))
    }

    fn carried(&self) -> Carried {
        Carried::Frames(Box::new(self.memory.clone()))
    }

    fn put_back(&mut self, carried: Carried) {
        if let Carried::Frames(memory) = carried {
            self.memory = *memory;
        }
    }

    fn set_sampling(&mut self, samples: bool) {
        self.samples = samples;
    }

    fn reading(&self, instruction: &str) -> Option<Reading> {
        let embedder = self.sentences.lock().ok()?;
        let count = embedder.encoder().tokens(&normalise(instruction)).ok()?;
        Some(Reading { tokens: count.used, cut: count.truncated })
    }
}
