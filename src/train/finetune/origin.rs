//! What a finetuning begins with: a checkpoint, with its own critic or another checkpoint's.

use std::path::Path;

use anyhow::{Context, ensure};
use tch::Device;
use tch::nn::VarStore;

use super::spec::Finetuning;
use crate::agent::checkpoint::Networks;
use crate::agent::config::CheckpointConfig;
use crate::agent::epsilon_greedy::EpsilonGreedy;
use crate::agent::learned::{LearnedPolicy, SharedEmbedder};
use crate::agent::memory_agent::config::MemoryConfig;
use crate::agent::policy_source;
use crate::nets::critic::CriticSpec;
use crate::nets::policy::PolicySpec;
use crate::nets::weights;
use crate::train::preset::Preset;

/// The agent that every task's training begins with. Nothing is dropped from its networks.
pub(super) struct Origin<'a> {
    spec: &'a Finetuning,
    /// As the checkpoint has it, before it is finetuned.
    given: CheckpointConfig,
    /// With the critic, and without dropout.
    pub(super) config: CheckpointConfig,
    /// SHA-256 of the checkpoint.
    pub(super) checkpoint_hash: String,
    /// SHA-256 of the critic's, where it is another one.
    pub(super) critic_hash: Option<String>,
    /// The hyper-parameters that the critic was trained with.
    pub(super) pretraining: Preset,
}

impl<'a> Origin<'a> {
    /// Reads what the checkpoints say of themselves.
    ///
    /// # Errors
    /// When there is no checkpoint, it is of an agent that cannot be finetuned, or there is no critic that fits it.
    pub(super) fn read(spec: &'a Finetuning) -> anyhow::Result<Origin<'a>> {
        let name = spec.checkpoint.display();
        ensure!(
            !MemoryConfig::is_there(&spec.checkpoint),
            "{name} is an agent with a memory: finetuning needs an agent of sprint, l-bc or am"
        );
        let given = CheckpointConfig::read(&spec.checkpoint)?;
        ensure!(
            given.policy.attention.is_none(),
            "{name} attends to words, which no critic here reads: finetuning needs an agent of sprint, l-bc or am"
        );
        {
            let embedder = spec.embedder.lock().map_err(|_| anyhow::anyhow!("the sentence encoder failed earlier"))?;
            let file = || spec.checkpoint.join("config.json").display().to_string();
            given.goes_with(embedder.encoder()).with_context(file)?;
        }
        let critic = match &spec.critic_from {
            None => given.critic.clone().with_context(|| {
                format!(
                    "{name} has no critic, which finetuning learns with: pretrain one on the same data with --preset \
                     iql-primitive and --visual-from {name}, and name it with --critic-from"
                )
            })?,
            Some(folder) => other_critic(folder, &given)?,
        };
        let pretraining = pretraining(spec.critic_from.as_deref().unwrap_or(&spec.checkpoint))?;
        let config = CheckpointConfig {
            policy: PolicySpec { dropout: 0.0, ..given.policy.clone() },
            critic: Some(CriticSpec { dropout: 0.0, ..critic }),
            ..given.clone()
        };
        let checkpoint_hash = policy_source::hash(&spec.checkpoint)?;
        let critic_hash = spec.critic_from.as_deref().map(policy_source::hash).transpose()?;
        let origin = Origin { spec, given, config, checkpoint_hash, critic_hash, pretraining };
        origin.check_visual_encoder()?;
        Ok(origin)
    }

    /// A critic knows feature maps of the encoder that it was trained with alone.
    fn check_visual_encoder(&self) -> anyhow::Result<()> {
        let Some(folder) = &self.spec.critic_from else { return Ok(()) };
        let digest = |folder: &Path, config: &CheckpointConfig| -> anyhow::Result<String> {
            Ok(Networks::load(folder, config, Device::Cpu)?.visual_encoder.frozen()?.digest().to_owned())
        };
        let found = digest(folder, &CheckpointConfig::read(folder)?)?;
        ensure!(
            found == digest(&self.spec.checkpoint, &self.given)?,
            "{}: its visual encoder is another than that of {}: pretrain it with --visual-from that",
            folder.display(),
            self.spec.checkpoint.display()
        );
        Ok(())
    }

    /// Networks as they are before the first update.
    ///
    /// # Errors
    /// When the weights cannot be read.
    pub(super) fn networks(&self) -> anyhow::Result<Networks> {
        let device = self.spec.device;
        let given = Networks::load(&self.spec.checkpoint, &self.given, device)?;
        let other = match &self.spec.critic_from {
            None => None,
            Some(folder) => Networks::load(folder, &CheckpointConfig::read(folder)?, device)?.critic,
        };
        let Networks { visual_encoder, policy_store, critic, .. } = given;
        let networks = Networks::new(visual_encoder, &self.config.policy, self.config.critic.as_ref(), device);
        copy(&policy_store, &networks.policy_store)?;
        if let (Some(from), Some(to)) = (other.or(critic), &networks.critic) {
            copy(&from.online_store, &to.online_store)?;
            copy(&from.target_store, &to.target_store)?;
        }
        Ok(networks)
    }

    /// The agent that collects: networks of its own, which follow those that learn.
    ///
    /// # Errors
    /// When the weights cannot be read.
    pub(super) fn explorer(&self, epsilon: f64) -> anyhow::Result<EpsilonGreedy> {
        let sentences: SharedEmbedder = self.spec.embedder.clone();
        let (networks, device) = (self.networks()?, self.spec.device);
        let agent = LearnedPolicy::with("agent".into(), self.config.clone(), networks, Some(sentences), device)?;
        Ok(EpsilonGreedy::new(agent, epsilon))
    }
}

/// The size of another checkpoint's critic, which has to be conditioned on and see the same.
fn other_critic(folder: &Path, given: &CheckpointConfig) -> anyhow::Result<CriticSpec> {
    let other = CheckpointConfig::read(folder)?;
    let name = folder.display();
    let critic = other.critic.with_context(|| {
        format!("{name} has no critic either: one of the presets iql-primitive, sprint or am trains one")
    })?;
    let same = other.sentence_encoder == given.sentence_encoder
        && other.policy.history == given.policy.history
        && other.policy.embedding == given.policy.embedding
        && other.policy.goal_channels == given.policy.goal_channels
        && other.visual_encoder == given.visual_encoder
        && other.resnet18 == given.resnet18;
    ensure!(same, "{name}: its critic reads or sees otherwise than the agent that is finetuned (see both config.json)");
    Ok(critic)
}

/// The hyper-parameters of a checkpoint's pre-training: those it keeps, or where it keeps none, its method's.
fn pretraining(folder: &Path) -> anyhow::Result<Preset> {
    let kept = folder.join("training/preset.toml");
    if let (true, Some(path)) = (kept.is_file(), kept.to_str()) {
        return Preset::named(path);
    }
    Preset::named(match CheckpointConfig::read(folder)?.method.as_deref() {
        Some("am") => "am",
        Some("iql") => "iql-primitive",
        _ => "sprint",
    })
}

fn copy(from: &VarStore, to: &VarStore) -> anyhow::Result<()> {
    weights::copy(&from.variables().into_iter().collect(), "", to)
}
