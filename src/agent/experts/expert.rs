//! The expert as a policy: it reads the grader, not the instruction.

use anyhow::Context;

use crate::agent::policy::{Decision, Observation, Policy, PolicyState};
use crate::house::expert::{Expert, TurnTiming};

/// Acts as the expert would.
#[derive(Default)]
pub struct ExpertPolicy {
    expert: Expert,
}

impl ExpertPolicy {
    /// A steady expert.
    pub fn new() -> ExpertPolicy {
        ExpertPolicy::default()
    }

    /// An expert that goes about things so.
    pub fn of(pace: TurnTiming) -> ExpertPolicy {
        ExpertPolicy { expert: Expert::of(pace) }
    }
}

impl Policy for ExpertPolicy {
    fn name(&self) -> &str {
        "expert"
    }

    fn begin(&mut self, _seed: u64) {
        self.expert.forget();
    }

    fn decide(&mut self, situation: &mut Observation<'_>) -> anyhow::Result<Decision> {
        let grader =
            situation.grader.context("the expert needs a task with subtasks; it does not read instructions")?;
        let action = self.expert.next(situation.house, grader)?;
        Ok(Decision { action, mind: None })
    }

    fn carried(&self) -> PolicyState {
        PolicyState::Plan(Box::new(self.expert.plan()))
    }

    fn put_back(&mut self, carried: PolicyState) {
        if let PolicyState::Plan(plan) = carried {
            self.expert.follow(*plan);
        }
    }
}
