//! Chance as a policy: uniform over the actions that are possible, then over the classes they could name.

use anyhow::Context;
use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use super::decision::{ActionDistribution, Decision};
use super::policy::{Decisions, Observation, Policy, PolicyState, each_alone};
use crate::domain::{Action, ActionType, Class};
use crate::env::remote_view::Possible;
use crate::house::view::{self, Candidate};

/// Draws every action by chance.
pub struct RandomPolicy {
    rng: ChaCha8Rng,
}

impl Default for RandomPolicy {
    fn default() -> RandomPolicy {
        RandomPolicy::new()
    }
}

impl RandomPolicy {
    /// A random policy; [`Policy::reset`] seeds it.
    pub fn new() -> RandomPolicy {
        RandomPolicy { rng: ChaCha8Rng::seed_from_u64(0) }
    }
}

/// The classes that an action could name now, in order.
fn classes(candidates: &[Candidate], kind: ActionType) -> Vec<Class> {
    let of_kind = candidates.iter().filter(|candidate| candidate.kind == kind);
    let mut classes: Vec<Class> = of_kind.map(|candidate| candidate.class).collect();
    classes.sort();
    classes.dedup();
    classes
}

impl Policy for RandomPolicy {
    fn name(&self) -> &str {
        "random"
    }

    fn slots(&self) -> usize {
        1
    }

    fn reset(&mut self, _slot: usize, seed: u64) {
        self.rng = ChaCha8Rng::seed_from_u64(seed);
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        each_alone(observations, |_, here| self.decide(here))
    }

    fn check_fits(&self, _start: &mut Observation<'_>) -> anyhow::Result<()> {
        Ok(())
    }

    fn state(&self, _slot: usize) -> PolicyState {
        PolicyState::Random(Box::new(self.rng.clone()))
    }

    fn restore(&mut self, _slot: usize, state: PolicyState) {
        if let PolicyState::Random(rng) = state {
            self.rng = *rng;
        }
    }
}

impl RandomPolicy {
    fn decide(&mut self, observation: &mut Observation<'_>) -> anyhow::Result<Decision> {
        if let Some(view) = observation.environment.own() {
            let possible = view.possible();
            return self.decide_among(&possible);
        }
        let candidates = observation.environment.legal_actions()?;
        let possible: Vec<ActionType> = ActionType::ALL
            .into_iter()
            .filter(|&kind| !kind.is_interaction() || candidates.iter().any(|candidate| candidate.kind == kind))
            .collect();
        // The five navigation actions are never masked, so there is always one to choose.
        let kind = possible.choose(&mut self.rng).copied().unwrap_or(ActionType::RotateRight);
        let named = classes(&candidates, kind);
        let target = named.choose(&mut self.rng).and_then(|&class| view::nearest(&candidates, kind, class));
        let action = Action { kind, target: target.map(|candidate| candidate.instance) };
        let chance = 1.0 / possible.len() as f32;
        let distribution = ActionDistribution {
            actions: ActionType::ALL.map(|kind| possible.contains(&kind).then_some(chance)),
            objects: named.iter().map(|&class| (class, 1.0 / named.len() as f32, true)).collect(),
            choices: Vec::new(),
            entropy: (possible.len() as f32).ln(),
            greedy: action,
        };
        Ok(Decision { distribution: Some(distribution), ..Decision::of(action) })
    }

    /// Uniform over the actions that are possible, then over their arguments.
    fn decide_among(&mut self, possible: &[Possible]) -> anyhow::Result<Decision> {
        let chosen = possible.choose(&mut self.rng).context("nothing is possible here")?;
        let actions = chosen.actions();
        let action = *actions.choose(&mut self.rng).context("nothing is possible here")?;
        let each = 1.0 / possible.len() as f32;
        let shares = possible.iter().flat_map(|one| {
            let actions = one.actions();
            let share = each / actions.len() as f32;
            actions.into_iter().map(move |action| (action, share))
        });
        Ok(Decision { own: Some(shares.collect()), ..Decision::of(action) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::{Environment, HouseEnvironment};
    use crate::house::testing::kitchen_house;

    fn walk(seed: u64) -> (String, usize) {
        let mut policy = RandomPolicy::new();
        let policy: &mut dyn Policy = &mut policy;
        policy.reset(0, seed);
        let mut environment = HouseEnvironment::new(kitchen_house(), None);
        let mut interactions = 0;
        for _ in 0..150 {
            let here = Observation { environment: &mut environment, instruction: "", step: 0, last: None };
            let action = policy.act_in(0, here).unwrap().action;
            let outcome = environment.step(action).unwrap().outcome;
            if action.target.is_some() {
                assert!(outcome.is_done(), "{action:?}: {outcome}");
                interactions += 1;
            }
        }
        (environment.fingerprint().unwrap(), interactions)
    }

    #[test]
    fn the_same_seed_walks_the_same_way_and_another_seed_does_not() {
        let (first, interactions) = walk(7);
        assert_eq!(walk(7), (first.clone(), interactions));
        assert_ne!(walk(8).0, first);
        assert!(interactions > 0);
    }
}
