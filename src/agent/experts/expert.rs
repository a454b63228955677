//! The expert as a policy: it reads the grader, not the instruction.

use anyhow::Context;

use crate::agent::decision::Decision;
use crate::agent::policy::{Decisions, Observation, Policy, PolicyState, each_alone};
use crate::env::HouseAccess;
use crate::house::House;
use crate::house::expert::{Expert, TurnTiming};
use crate::house::grading::Grader;

/// Acts as the expert would; in one episode at a time.
#[derive(Default)]
pub(crate) struct ExpertPolicy {
    expert: Expert,
}

impl ExpertPolicy {
    /// An expert that turns as late as it may.
    pub(crate) fn new() -> ExpertPolicy {
        ExpertPolicy::default()
    }

    /// An expert that turns at that time.
    pub(crate) fn of(timing: TurnTiming) -> ExpertPolicy {
        ExpertPolicy { expert: Expert::of(timing) }
    }
}

/// The house that an expert knows, with the grader that it reads.
pub(super) fn task_in<'a>(observation: &'a mut Observation<'_>) -> anyhow::Result<(&'a mut House, &'a Grader)> {
    let name = observation.environment.name().to_owned();
    let access = observation.environment.house();
    let HouseAccess { house, grader } =
        access.with_context(|| format!("the expert knows its way in House, not in {name}"))?;
    Ok((house, grader.context("the expert needs a task with subtasks; it does not read instructions")?))
}

impl Policy for ExpertPolicy {
    fn name(&self) -> &str {
        "expert"
    }

    fn slots(&self) -> usize {
        1
    }

    fn reset(&mut self, _slot: usize, _seed: u64) {
        self.expert.reset();
    }

    fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
        each_alone(observations, |_, here| {
            let (house, grader) = task_in(here)?;
            Ok(Decision::of(self.expert.next(house, grader)?))
        })
    }

    fn state(&self, _slot: usize) -> PolicyState {
        PolicyState::Plan(Box::new(self.expert.state()))
    }

    fn restore(&mut self, _slot: usize, state: PolicyState) {
        if let PolicyState::Plan(plan) = state {
            self.expert.restore(*plan);
        }
    }
}
