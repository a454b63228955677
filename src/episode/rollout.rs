//! The one loop that steps an environment; the explorer, the evaluator and the collector all go through it.

use serde::{Deserialize, Serialize};

use crate::agent::{Decision, Observation, Policy};
use crate::domain::{Action, World};
use crate::house::grading::Grader;
use crate::house::{House, Outcome};

/// An episode under way: a house, what is asked, and how far it has come.
pub struct Rollout {
    /// Where it happens.
    pub house: House,
    /// What the agent is told; may change between steps.
    pub instruction: String,
    /// Follows the subtasks, where there is a task.
    pub grader: Option<Grader>,
    /// After how many steps it ends; `None` for no limit.
    pub horizon: Option<u32>,
    steps: u32,
}

/// One step that was taken.
#[derive(Clone, Debug)]
pub struct Tick {
    /// Which step, from 1.
    pub step: u32,
    /// What was done, and the mind behind it; a person's action has none.
    pub decision: Decision,
    /// What it came to.
    pub outcome: Outcome,
    /// A subtask was completed by it.
    pub completed_one: bool,
}

/// Why an episode is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// Every subtask is done.
    Success,
    /// The horizon is reached.
    Timeout,
}

impl Rollout {
    /// An episode at its start.
    pub fn new(house: House, instruction: String, grader: Option<Grader>, horizon: Option<u32>) -> Rollout {
        Rollout { house, instruction, grader, horizon, steps: 0 }
    }

    /// How many steps were taken.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Whether it is over, and why.
    pub fn end(&self) -> Option<End> {
        if self.grader.as_ref().is_some_and(Grader::is_done) {
            return Some(End::Success);
        }
        self.horizon.is_some_and(|horizon| self.steps >= horizon).then_some(End::Timeout)
    }

    /// What `policy` would do now, without doing it.
    ///
    /// # Errors
    /// Whatever the policy reports.
    pub fn decide(&mut self, policy: &mut dyn Policy) -> anyhow::Result<Decision> {
        policy.decide(&mut self.situation())
    }

    /// What a policy decides from now.
    pub fn situation(&mut self) -> Observation<'_> {
        Observation {
            house: &mut self.house,
            instruction: &self.instruction,
            step: self.steps,
            grader: self.grader.as_ref(),
        }
    }

    /// Goes on from another state, `steps` into the episode.
    pub fn resume(&mut self, world: World, grader: Option<Grader>, steps: u32) {
        self.house.restore(world);
        self.grader = grader;
        self.steps = steps;
    }

    /// Takes one step by `policy`'s choice.
    ///
    /// # Errors
    /// Whatever the policy reports; nothing was done then.
    pub fn step(&mut self, policy: &mut dyn Policy) -> anyhow::Result<Tick> {
        let decision = self.decide(policy)?;
        Ok(self.carry_out(decision))
    }

    /// Takes one step that a person chose.
    pub fn act(&mut self, action: Action) -> Tick {
        self.carry_out(Decision { action, mind: None })
    }

    /// Takes one step that was decided.
    pub fn carry_out(&mut self, decision: Decision) -> Tick {
        let outcome = self.house.step(decision.action);
        self.steps += 1;
        let completed_one = match &mut self.grader {
            Some(grader) => grader.observe(self.house.scene(), self.house.world(), decision.action, outcome),
            None => false,
        };
        Tick { step: self.steps, decision, outcome, completed_one }
    }
}
