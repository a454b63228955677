//! Rollouts of an exploring agent, side by side in the slots of its policy, with what it saw.

use std::sync::Arc;

use anyhow::Context;
use tch::Tensor;

use super::replay::{ReplayEpisode, ReplayStep};
use crate::agent::Policy;
use crate::agent::epsilon_greedy::EpsilonGreedy;
use crate::domain::Task;
use crate::env::{Environment, HouseEnvironment};
use crate::episode::instruction_variant::task_instruction;
use crate::episode::rollout::{End, Rollout, decide_all};
use crate::episode::scenes::Setting;
use crate::episode::seed::mix;
use crate::house::House;
use crate::house::grading::Grading;
use crate::train::feature_cache::add_half;

/// A task where it starts.
#[derive(Clone)]
pub(super) struct Start {
    pub(super) task: Arc<Task>,
    pub(super) setting: Setting,
    pub(super) grading: Grading,
}

/// A rollout with the maps of its frames, 16-bit floats.
pub(super) struct Collected {
    pub(super) episode: ReplayEpisode,
    pub(super) maps: Vec<u8>,
}

impl Start {
    /// An episode at its start.
    fn rollout(&self) -> Rollout {
        let house = House::new(self.setting.scene.clone(), self.setting.world.clone());
        let environment = HouseEnvironment::of_task(&self.task, house, self.grading);
        Rollout::new(environment, task_instruction(&self.task, false), Some(self.task.horizon))
    }

    /// What conditions the agent throughout the task, [1, ...] as its networks take it.
    ///
    /// # Errors
    /// When the instruction cannot be embedded, or the goal not be shown.
    pub(super) fn conditioning(&self, policy: &mut EpsilonGreedy) -> anyhow::Result<Tensor> {
        policy.reset(0, 0);
        Ok(policy.agent.perceive(0, &mut self.rollout().observation())?.conditioning)
    }
}

/// Plays these rollouts, at most one a slot, each by random numbers of its own.
///
/// # Errors
/// When the policy or the environment fails.
pub(super) fn play(
    policy: &mut EpsilonGreedy,
    start: &Start,
    seed: u64,
    numbers: impl Iterator<Item = u64>,
) -> anyhow::Result<Vec<Collected>> {
    let slots = policy.slots();
    let mut rollouts: Vec<Option<Rollout>> = (0..slots).map(|_| None).collect();
    let mut played: Vec<Collected> = Vec::new();
    for (slot, number) in numbers.enumerate() {
        let place = rollouts.get_mut(slot).with_context(|| format!("there are {slots} slots"))?;
        policy.reset(slot, mix(seed, number));
        *place = Some(start.rollout());
        let of = start.task.subtasks.len() as u32;
        let episode = ReplayEpisode { epsilon: policy.epsilon, completed: 0, of, steps: Vec::new() };
        played.push(Collected { episode, maps: Vec::new() });
    }
    while rollouts.iter().any(Option::is_some) {
        let decisions = decide_all(policy, &mut rollouts)?;
        for (slot, decision) in decisions.into_iter().enumerate() {
            let (Some(decision), Some(rollout), Some(into)) = (decision, &mut rollouts[slot], played.get_mut(slot))
            else {
                continue;
            };
            add_half(&policy.agent.latest_map(slot)?, &mut into.maps)?;
            let action = decision.as_ref().map_or(None, |decision| Some(decision.action));
            let class = action.and_then(|action| action.target).and_then(|target| rollout.env.class_of(target));
            let object = class.filter(|class| class.in_vocabulary()).map_or(0, |class| class.index() as u8);
            let tick = rollout.carry_out(decision?)?;
            let (episode, end) = (&mut into.episode, rollout.end());
            episode.completed += u32::from(tick.completed_one);
            episode.steps.push(ReplayStep {
                action: tick.decision.action.kind.index() as u8,
                object,
                reward: if tick.completed_one { 1.0 / episode.of.max(1) as f32 } else { 0.0 },
                terminal: end == Some(End::Success),
            });
            if end.is_some() {
                policy.agent.perceive(slot, &mut rollout.observation())?;
                add_half(&policy.agent.latest_map(slot)?, &mut into.maps)?;
                rollouts[slot] = None;
            }
        }
    }
    Ok(played)
}
