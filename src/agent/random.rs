//! Chance as a policy: uniform over the actions that are possible, then over the classes they could name.

use rand::SeedableRng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use super::policy::{ActionDistribution, Decision, Observation, Policy, PolicyState};
use crate::domain::{Action, ActionType, Class};
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
    /// A random policy; [`Policy::begin`] seeds it.
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

    fn begin(&mut self, seed: u64) {
        self.rng = ChaCha8Rng::seed_from_u64(seed);
    }

    fn decide(&mut self, situation: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let candidates = situation.house.candidates();
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
        let mind = ActionDistribution {
            actions: ActionType::ALL.map(|kind| possible.contains(&kind).then_some(chance)),
            objects: named.iter().map(|&class| (class, 1.0 / named.len() as f32, true)).collect(),
            choices: Vec::new(),
            entropy: (possible.len() as f32).ln(),
            greedy: action,
        };
        Ok(Decision { action, mind: Some(mind) })
    }

    fn carried(&self) -> PolicyState {
        PolicyState::Chance(Box::new(self.rng.clone()))
    }

    fn put_back(&mut self, carried: PolicyState) {
        if let PolicyState::Chance(rng) = carried {
            self.rng = *rng;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::house::testing::kitchen_house;

    fn walk(seed: u64) -> (String, usize) {
        let mut policy = RandomPolicy::new();
        policy.begin(seed);
        let mut house = kitchen_house();
        let mut interactions = 0;
        for _ in 0..150 {
            let mut situation = Observation { house: &mut house, instruction: "", step: 0, grader: None };
            let action = policy.decide(&mut situation).unwrap().action;
            let outcome = house.step(action);
            if action.target.is_some() {
                assert!(outcome.is_done(), "{action:?}: {outcome}");
                interactions += 1;
            }
        }
        (house.world().digest(), interactions)
    }

    #[test]
    fn the_same_seed_walks_the_same_way_and_another_seed_does_not() {
        let (first, interactions) = walk(7);
        assert_eq!(walk(7), (first.clone(), interactions));
        assert_ne!(walk(8).0, first);
        assert!(interactions > 0);
    }
}
