//! A trained agent: sees the last frames, reads the instruction, decides.

use std::path::Path;

use anyhow::Context;
use tch::{Device, Tensor};

use super::checkpoint::Networks;
use super::conditioning;
use super::config::Config;
use super::frame_history::FrameHistory;
pub use super::frame_history::SharedEmbedder;
use super::policy::{Decision, Observation, Policy, PolicyState, Reading};
use super::select::Heads;
use super::value_estimates::Values;
use crate::nets::frozen::FrameEncoder;

/// A policy from a checkpoint.
pub struct LearnedPolicy {
    pub(super) name: String,
    pub(super) config: Config,
    pub(super) networks: Networks,
    /// The visual encoder of the networks, for computing alone.
    pub(super) sight: Box<dyn FrameEncoder>,
    pub(super) sentences: SharedEmbedder,
    pub(super) device: Device,
    pub(super) samples: bool,
    pub(super) memory: FrameHistory,
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
            config.goes_with(embedder.encoder()).with_context(|| folder.join("config.json").display().to_string())?;
        }
        let networks = Networks::load(folder, &config, device)?;
        let name = folder.file_name().map_or_else(|| "agent".to_string(), |name| name.to_string_lossy().into_owned());
        LearnedPolicy::with(name, config, networks, sentences, device)
    }

    /// A policy of networks at hand.
    ///
    /// # Errors
    /// When the visual encoder's weights cannot be read.
    pub fn with(
        name: String,
        config: Config,
        networks: Networks,
        sentences: SharedEmbedder,
        device: Device,
    ) -> anyhow::Result<LearnedPolicy> {
        let sight = networks.eyes.frozen()?;
        let memory = FrameHistory::default();
        Ok(LearnedPolicy { name, config, networks, sight, sentences, device, samples: false, memory })
    }

    /// The checkpoint's configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The last frames' maps as one observation, and what the agent is told.
    fn perceive(&mut self, situation: &mut Observation<'_>) -> anyhow::Result<(Tensor, Tensor)> {
        let image = self.sight.image(situation.house.frame());
        let map = self.memory.map_of(&image).unwrap_or_else(|| self.sight.encode(std::slice::from_ref(&image)));
        self.memory.look(&image, situation.step);
        let observation = self.memory.observe(map, situation.step, self.config.policy.history as usize);
        let hear = || conditioning::told(situation, &self.config, &*self.sight, &self.sentences, self.device);
        Ok((observation, self.memory.told(situation.instruction, hear)?))
    }
}

impl Policy for LearnedPolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn begin(&mut self, seed: u64) {
        self.memory.begin(seed);
    }

    fn decide(&mut self, situation: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let (observation, told) = self.perceive(situation)?;
        let logits = tch::no_grad(|| self.networks.policy.forward(&observation, &told, false));
        let numbers = |tensor: Tensor| Vec::<f32>::try_from(tensor.flatten(0, -1).to_device(Device::Cpu));
        let (mut actions, objects) = (numbers(logits.actions)?, numbers(logits.objects)?);
        self.config.logit_adjustment(&mut actions);
        let candidates = situation.house.candidates();
        let values = self.networks.advice(&self.config, &observation, &told, &candidates)?;
        let heads = Heads {
            actions: &actions,
            objects: &objects,
            advantage_scale: self.config.advantage_scale(values.as_ref()),
        };
        Ok(self.memory.decide(&heads, &candidates, self.samples))
    }

    fn carried(&self) -> PolicyState {
        PolicyState::Frames(Box::new(self.memory.clone()))
    }

    fn put_back(&mut self, carried: PolicyState) {
        if let PolicyState::Frames(memory) = carried {
            self.memory = *memory;
        }
    }

    fn set_sampling(&mut self, samples: bool) {
        self.samples = samples;
    }

    fn reading(&self, instruction: &str) -> Option<Reading> {
        conditioning::reading(instruction, &self.config, &self.sentences)
    }

    fn values(&mut self, situation: &mut Observation<'_>) -> anyhow::Result<Option<Values>> {
        if self.networks.critic.is_none() {
            return Ok(None);
        }
        let (observation, told) = self.perceive(situation)?;
        let Some(critic) = &self.networks.critic else { return Ok(None) };
        Values::of(&critic.online, &observation, &told, &situation.house.candidates()).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::agent::config::tests::small;
    use crate::domain::{ActionType, SkillKind};
    use crate::house::grading::{Grader, Grading};
    use crate::house::testing::{kitchen_house, role, subtask};
    use crate::nets::critic::CriticSpec;
    use crate::nets::embedding_cache::Embedder;
    use crate::nets::episodic::AttentionSpec;
    use crate::nets::policy::PolicySpec;
    use crate::nets::sentence::{SentenceEncoder, default_folder};

    /// A fresh agent with a critic; nothing where there is no sentence encoder.
    fn agent(goal: Option<[i64; 4]>) -> Option<LearnedPolicy> {
        let folder = default_folder();
        if !folder.join("model.safetensors").exists() {
            eprintln!("skipped: needs the sentence encoder (`make setup`)");
            return None;
        }
        let embedder = Embedder::new(SentenceEncoder::load(&folder, Device::Cpu).unwrap(), None);
        let embedding = embedder.encoder().width() as i64;
        let small = small();
        let config = Config {
            policy: PolicySpec { embedding, goal, ..small.policy },
            critic: Some(CriticSpec {
                channels: [4; 4],
                halved: false,
                hidden: vec![8],
                dropout: 0.2,
                action_embedding: 4,
                object_embedding: 4,
                shared_trunk: true,
            }),
            ..small
        };
        let networks =
            Networks::new(config.eyes(Device::Cpu).unwrap(), &config.policy, config.critic.as_ref(), Device::Cpu);
        LearnedPolicy::with("a".into(), config, networks, Arc::new(Mutex::new(embedder)), Device::Cpu).ok()
    }

    #[test]
    fn a_critic_values_what_is_possible_and_changes_no_decision() {
        let _chance = crate::nets::testing::chance();
        let Some(mut agent) = agent(None) else { return };
        agent.begin(1);
        let mut house = kitchen_house();
        let mut situation = Observation { house: &mut house, instruction: "take the mug", step: 0, grader: None };
        let decision = agent.decide(&mut situation).unwrap();
        let values = agent.values(&mut situation).unwrap().unwrap();
        assert_eq!(agent.decide(&mut situation).unwrap().action, decision.action);
        let candidates = situation.house.candidates();
        let wanted: std::collections::BTreeSet<_> = candidates.iter().map(|c| (c.kind, c.class.index())).collect();
        assert_eq!(values.choices.len(), 5 + wanted.len());
        assert!(values.state.is_finite() && values.q(ActionType::MoveAhead, None).is_some());
    }

    #[test]
    fn an_agent_says_how_much_of_an_instruction_it_reads() {
        let _chance = crate::nets::testing::chance();
        let Some(mut told) = agent(None) else { return };
        let read = told.reading("take the mug").unwrap();
        assert!(read.tokens > 3 && read.cut == 0, "{read:?}");
        assert_eq!(agent(Some([4; 4])).unwrap().reading("take the mug"), None, "it is shown its goal");
        told.config.policy.attention = Some(AttentionSpec { words: 9, layers: 1, heads: 1, inner: 4 });
        assert_eq!(told.reading("take the mug"), Some(Reading { tokens: 3, cut: 0 }));
        assert_eq!(told.reading(&"mug ".repeat(130)), Some(Reading { tokens: 128, cut: 2 }));
    }

    #[test]
    fn an_agent_that_is_shown_its_goal_needs_a_task() {
        let _chance = crate::nets::testing::chance();
        let Some(mut agent) = agent(Some([4; 4])) else { return };
        agent.begin(1);
        let mut house = kitchen_house();
        let mut decide = |grader: Option<&Grader>| {
            agent.decide(&mut Observation { house: &mut house, instruction: "", step: 0, grader }).map(|_| ())
        };
        assert!(decide(None).unwrap_err().to_string().contains("which a task has"));
        let grader = Grader::new(Grading::default(), &[role("Mug")], &[subtask(SkillKind::Pickup, 0)], None);
        decide(Some(&grader)).unwrap();
    }
}
