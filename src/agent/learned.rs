//! A trained agent: sees the last frames, reads the instruction, decides; in several episodes at once, with one forward pass
//! for all of them.
//!
//! The pass always has the same shape: an empty slot is a row of zeros. A row of a pass of one shape is computed the same way
//! whatever the other rows hold, so a decision depends on its own episode and slot alone; the tests hold this.

use std::path::Path;

use anyhow::Context;
use tch::nn::VarStore;
use tch::{Device, Kind, Tensor};

use super::checkpoint::Networks;
use super::conditioning;
use super::config::CheckpointConfig;
use super::decision::Decision;
use super::decision_rule::{DecisionOverride, DecisionRule};
use super::frame_history::FrameHistory;
pub(crate) use super::frame_history::SharedEmbedder;
use super::policy::{Decisions, Observation, Policy, PolicyState, Reading};
use super::select::Heads;
use super::value_estimates::Values;
use crate::domain::Action;
use crate::house::view::Candidate;
use crate::nets::frozen::FrameEncoder;
use crate::nets::visual::SIDE;
use crate::nets::weights;

/// A policy from a checkpoint.
pub(crate) struct LearnedPolicy {
    name: String,
    config: CheckpointConfig,
    networks: Networks,
    /// The visual encoder of the networks, for computing alone.
    encoder: Box<dyn FrameEncoder>,
    sentences: Option<SharedEmbedder>,
    device: Device,
    samples: bool,
    /// The checkpoint's own rule, and whether it has a loop guard: what is asked for may be taken back.
    own: (DecisionRule, bool),
    slots: Vec<FrameHistory>,
}

/// What the networks take of a slot: an observation [1, history x features, 7, 7], and what conditions it.
pub(crate) struct PolicyInputs {
    observation: Tensor,
    pub(crate) conditioning: Tensor,
}

impl LearnedPolicy {
    /// Rows of a pass: enough to read the weights once for several episodes, few enough to stay in a processor's caches.
    pub(crate) const SLOTS: usize = 8;

    /// Loads a checkpoint; it decides greedily.
    ///
    /// # Errors
    /// When the checkpoint is malformed, or was trained with another sentence encoder.
    pub(crate) fn load(
        folder: &Path,
        sentences: Option<SharedEmbedder>,
        device: Device,
    ) -> anyhow::Result<LearnedPolicy> {
        let config = CheckpointConfig::read(folder)?;
        if let Some(sentences) = &sentences {
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
    pub(crate) fn with(
        name: String,
        config: CheckpointConfig,
        networks: Networks,
        sentences: Option<SharedEmbedder>,
        device: Device,
    ) -> anyhow::Result<LearnedPolicy> {
        let encoder = networks.visual_encoder.frozen()?;
        let slots = (0..LearnedPolicy::SLOTS).map(|_| FrameHistory::default()).collect();
        let own = (config.decision, config.loop_guard);
        Ok(LearnedPolicy { name, config, networks, encoder, sentences, device, samples: false, own, slots })
    }

    /// Decides from now on by the weights of networks of the same size that learn elsewhere.
    ///
    /// # Errors
    /// When they are of another size.
    pub(crate) fn take_weights(&mut self, learning: &Networks) -> anyhow::Result<()> {
        let copy = |from: &VarStore, to: &VarStore| weights::copy(&from.variables().into_iter().collect(), "", to);
        copy(&learning.policy_store, &self.networks.policy_store)?;
        match (&learning.critic, &self.networks.critic) {
            (Some(learning), Some(own)) => copy(&learning.online_store, &own.online_store),
            (None, None) => Ok(()),
            _ => anyhow::bail!("one of both agents has a critic, and the other none"),
        }
    }

    /// The feature map [1, features, 7, 7] of the frame that a slot looked at last.
    ///
    /// # Errors
    /// When it has looked at none.
    pub(crate) fn latest_map(&self, slot: usize) -> anyhow::Result<Tensor> {
        let latest = self.slots.get(slot).and_then(FrameHistory::latest);
        latest.map(Tensor::shallow_clone).with_context(|| format!("slot {slot} has seen no frame"))
    }

    /// Another action than the one that was decided is taken in a slot.
    pub(crate) fn overrule(&mut self, slot: usize, action: Action, candidates: &[Candidate]) {
        if let Some(history) = self.slots.get_mut(slot) {
            history.overrule(action, candidates);
        }
    }

    /// Looks at a slot's observation without deciding.
    ///
    /// # Errors
    /// When the frame cannot be drawn, or what conditions the agent not be had.
    pub(crate) fn perceive(&mut self, slot: usize, here: &mut Observation<'_>) -> anyhow::Result<PolicyInputs> {
        let image = self.encoder.image(here.environment.frame()?);
        let slots = self.slots.len();
        let history = self.slots.get_mut(slot).with_context(|| format!("there are {slots} slots, not {slot}"))?;
        // A frame is encoded by itself, so that what it comes to does not depend on what other slots see.
        let map = history.map_of(&image).unwrap_or_else(|| self.encoder.encode(std::slice::from_ref(&image)));
        history.look(&image, here.step);
        let observation = history.observe(map, here.step, self.config.policy.history as usize);
        let instruction = here.instruction;
        let condition = || conditioning::of(here, &self.config, &*self.encoder, self.sentences.as_ref(), self.device);
        Ok(PolicyInputs { observation, conditioning: history.conditioning(instruction, condition)? })
    }

    fn blank(&self) -> PolicyInputs {
        let channels = self.config.policy.history * self.config.features();
        PolicyInputs {
            observation: Tensor::zeros([1, channels, SIDE, SIDE], (Kind::Float, self.device)),
            conditioning: conditioning::blank(&self.config, self.device),
        }
    }

    fn decide(
        &mut self,
        slot: usize,
        here: &mut Observation<'_>,
        of: &PolicyInputs,
        logits: Rows,
    ) -> anyhow::Result<Decision> {
        let candidates = here.environment.legal_actions()?;
        // The critic computes a pass for each slot by itself.
        let values = self.networks.advice(&self.config, &of.observation, &of.conditioning, &candidates)?;
        let heads = Heads {
            actions: logits.actions,
            objects: logits.objects,
            advantage_scale: self.config.advantage_scale(values.as_ref()),
            rule: self.config.decision,
        };
        let decision = self.slots[slot].decide(&heads, &candidates, self.samples, self.config.loop_guard);
        Ok(Decision { values, ..decision })
    }
}

/// A slot's rows of the policy's heads.
#[derive(Clone, Copy)]
struct Rows<'a> {
    actions: &'a [f32],
    objects: &'a [f32],
}

/// The numbers of a tensor [n, width], with the width.
fn numbers(tensor: Tensor) -> anyhow::Result<(usize, Vec<f32>)> {
    let width = tensor.size()[1] as usize;
    Ok((width, Vec::<f32>::try_from(tensor.flatten(0, -1).to_device(Device::Cpu))?))
}

impl Policy for LearnedPolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn slots(&self) -> usize {
        self.slots.len()
    }

    fn reset(&mut self, slot: usize, seed: u64) {
        if let Some(history) = self.slots.get_mut(slot) {
            history.reset(seed);
        }
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        let (given, slots) = (observations.len(), self.slots.len());
        anyhow::ensure!(given == slots, "{given} observations for {slots} slots");
        let mut inputs: Vec<Option<anyhow::Result<PolicyInputs>>> = Vec::with_capacity(slots);
        for (slot, here) in observations.iter_mut().enumerate() {
            inputs.push(here.as_mut().map(|here| self.perceive(slot, here)));
        }
        let blank = self.blank();
        let seen = |input: &Option<anyhow::Result<PolicyInputs>>, part: fn(&PolicyInputs) -> &Tensor| {
            part(input.as_ref().and_then(|input| input.as_ref().ok()).unwrap_or(&blank)).shallow_clone()
        };
        let together = |part: fn(&PolicyInputs) -> &Tensor| {
            Tensor::cat(&inputs.iter().map(|input| seen(input, part)).collect::<Vec<_>>(), 0)
        };
        let (observation, conditioning) = (together(|of| &of.observation), together(|of| &of.conditioning));
        let logits = tch::no_grad(|| self.networks.policy.forward(&observation, &conditioning, false));
        let ((kinds, mut actions), (classes, objects)) = (numbers(logits.actions)?, numbers(logits.objects)?);
        actions.chunks_exact_mut(kinds).for_each(|row| self.config.adjust_logits(row));
        let rows = actions.chunks_exact(kinds).zip(objects.chunks_exact(classes));
        let mut decided = Vec::with_capacity(slots);
        for (slot, ((here, input), (actions, objects))) in observations.iter_mut().zip(inputs).zip(rows).enumerate() {
            decided.push(match (here, input) {
                (Some(here), Some(Ok(input))) => Some(self.decide(slot, here, &input, Rows { actions, objects })),
                (_, Some(Err(error))) => Some(Err(error)),
                _ => None,
            });
        }
        Ok(decided)
    }

    fn state(&self, slot: usize) -> PolicyState {
        self.slots.get(slot).map_or(PolicyState::Nothing, |history| PolicyState::Frames(Box::new(history.clone())))
    }

    fn restore(&mut self, slot: usize, state: PolicyState) {
        if let (PolicyState::Frames(frames), Some(history)) = (state, self.slots.get_mut(slot)) {
            *history = *frames;
        }
    }

    fn set_sampling(&mut self, samples: bool) {
        self.samples = samples;
    }

    fn set_deciding(&mut self, asked: DecisionOverride) {
        self.config.decision = asked.decision.unwrap_or(self.own.0);
        self.config.loop_guard = asked.loop_guard.unwrap_or(self.own.1);
    }

    fn reading(&self, instruction: &str) -> Option<Reading> {
        conditioning::reading(instruction, &self.config, self.sentences.as_ref())
    }

    fn values(&mut self, slot: usize, observation: &mut Observation<'_>) -> anyhow::Result<Option<Values>> {
        if self.networks.critic.is_none() {
            return Ok(None);
        }
        let of = self.perceive(slot, observation)?;
        let Some(critic) = &self.networks.critic else { return Ok(None) };
        Values::of(&critic.online, &of.observation, &of.conditioning, &observation.environment.legal_actions()?)
            .map(Some)
    }
}

#[cfg(test)]
pub(crate) mod tests;
