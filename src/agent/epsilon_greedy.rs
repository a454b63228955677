//! Epsilon-greedy exploration: a trained agent, whose decision now and then gives way to a possible action by chance.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::learned::LearnedPolicy;
use super::policy::{Decisions, Observation, Policy};
use super::random::RandomPolicy;

/// Mixed into an episode's seed: whether chance decides is drawn from another random stream than what it decides.
const COIN: u64 = 0xe951;

/// An agent that explores. One draw a step decides whether chance takes over, and then draws action and class.
pub(crate) struct EpsilonGreedy {
    /// Decides the other steps.
    pub(crate) agent: LearnedPolicy,
    /// The share of the steps at which chance decides.
    pub(crate) epsilon: f64,
    slots: Vec<Chance>,
}

/// A slot's random numbers.
struct Chance {
    coin: ChaCha8Rng,
    policy: RandomPolicy,
}

impl EpsilonGreedy {
    /// The agent, with chance at a share of `epsilon` of the steps.
    pub(crate) fn new(agent: LearnedPolicy, epsilon: f64) -> EpsilonGreedy {
        let fresh = |_| Chance { coin: ChaCha8Rng::seed_from_u64(COIN), policy: RandomPolicy::new() };
        EpsilonGreedy { slots: (0..agent.slots()).map(fresh).collect(), agent, epsilon }
    }
}

impl Policy for EpsilonGreedy {
    fn name(&self) -> &str {
        self.agent.name()
    }

    fn slots(&self) -> usize {
        self.agent.slots()
    }

    fn reset(&mut self, slot: usize, seed: u64) {
        self.agent.reset(slot, seed);
        if let Some(chance) = self.slots.get_mut(slot) {
            chance.coin = ChaCha8Rng::seed_from_u64(seed ^ COIN);
            chance.policy.reset(0, seed);
        }
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        let mut decided = self.agent.act(observations)?;
        for (slot, (here, decision)) in observations.iter_mut().zip(&mut decided).enumerate() {
            let (Some(Ok(_)), Some(chance)) = (decision.as_ref(), self.slots.get_mut(slot)) else { continue };
            if !chance.coin.random_bool(self.epsilon.clamp(0.0, 1.0)) {
                continue;
            }
            let explored = chance.policy.act(std::slice::from_mut(here))?.into_iter().next().flatten();
            if let (Some(Ok(explored)), Some(here)) = (&explored, here) {
                self.agent.overrule(slot, explored.action, &here.environment.legal_actions()?);
            }
            *decision = explored;
        }
        Ok(decided)
    }

    fn set_sampling(&mut self, samples: bool) {
        self.agent.set_sampling(samples);
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::agent::learned::tests::undecided;
    use crate::domain::Action;
    use crate::episode::rollout::{AfterEach, Rollout, Tick};
    use crate::house::testing::kitchen_house;

    /// What a policy does in the test kitchen.
    fn taken(policy: &mut dyn Policy, seed: u64) -> Vec<Action> {
        policy.reset(0, seed);
        let mut rollout = Rollout::in_house(kitchen_house(), "Take the mug.".into(), None, Some(12));
        let mut actions = Vec::new();
        let mut note = AfterEach(|_: &mut Rollout, tick: &Tick| {
            actions.push(tick.decision.action);
            Ok(ControlFlow::Continue(()))
        });
        rollout.run(policy, &mut note).unwrap();
        actions
    }

    #[test]
    fn without_exploration_the_agent_decides_and_with_it_chance_by_the_episodes_seed() {
        let _chance = crate::nets::testing::chance();
        let (Some(mut alone), Some(agent)) = (undecided(), undecided()) else { return };
        let mut explorer = EpsilonGreedy::new(agent, 0.0);
        assert_eq!(taken(&mut explorer, 1), taken(&mut alone, 1));
        explorer.epsilon = 1.0;
        let [one, again, other] = [1, 1, 2].map(|seed| taken(&mut explorer, seed));
        assert_eq!(one, again);
        assert_ne!(one, other);
        assert_ne!(one, taken(&mut alone, 1));
    }
}
