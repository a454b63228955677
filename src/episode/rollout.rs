//! The one loop that steps an environment; the explorer, the evaluator, verification and collection all go through it.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use crate::agent::{Decision, Decisions, Observation, Policy, Values};
use crate::domain::Action;
use crate::env::environment::Transition;
use crate::env::{Environment, HouseEnvironment};
use crate::house::grading::Grader;
use crate::house::{House, Outcome};

/// An episode under way: an environment, what is asked, and how far it has come.
pub(crate) struct Rollout<E = HouseEnvironment> {
    /// Where it happens.
    pub(crate) env: E,
    /// What the agent is told; may change between steps.
    pub(crate) instruction: String,
    /// After how many steps it ends; `None` for no limit.
    pub(crate) horizon: Option<u32>,
    /// Whose word ends it before that. An agent's is heard by whoever asks it to decide.
    pub(crate) ended_by: EndedBy,
    /// In which of its slots a policy decides here.
    pub(crate) slot: usize,
    steps: u32,
    last: Option<Action>,
}

/// One step that was taken.
#[derive(Clone, Debug)]
pub(crate) struct Tick {
    /// Which step, from 1.
    pub(crate) step: u32,
    /// What was done, and what was behind it.
    pub(crate) decision: Decision,
    /// What it came to.
    pub(crate) outcome: Outcome,
    /// A subtask was completed by it.
    pub(crate) completed_one: bool,
    /// What it earned, where the environment tells.
    pub(crate) reward: Option<f64>,
}

/// Why an episode is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum End {
    /// Every subtask is done.
    Success,
    /// The horizon is reached.
    Timeout,
    /// The environment ended it by itself.
    Environment,
}

/// Whose word ends an episode before its time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EndedBy {
    /// The grader's: every subtask is done.
    #[default]
    Grader,
    /// The agent's own: it says that it is done.
    Agent,
}

impl EndedBy {
    /// Whether it is the grader's word, as in the paper.
    pub(crate) fn is_grader(&self) -> bool {
        *self == EndedBy::Grader
    }

    /// For whoever reads a result: nothing for the paper's way.
    pub(crate) fn in_words(self) -> &'static str {
        match self {
            EndedBy::Grader => "",
            EndedBy::Agent => "; ended by the agent's own word",
        }
    }
}

/// Looks on while a rollout goes its way, and may end it.
pub(crate) trait Observer<E> {
    /// Before each step, when it is known what will be done. The policy may be asked further questions.
    ///
    /// # Errors
    /// Ends the rollout before the step.
    fn before(
        &mut self,
        _rollout: &mut Rollout<E>,
        _policy: Option<&mut dyn Policy>,
        _decision: &Decision,
    ) -> anyhow::Result<ControlFlow<()>> {
        Ok(ControlFlow::Continue(()))
    }

    /// After each step.
    ///
    /// # Errors
    /// Ends the rollout after the step.
    fn after(&mut self, _rollout: &mut Rollout<E>, _tick: &Tick) -> anyhow::Result<ControlFlow<()>> {
        Ok(ControlFlow::Continue(()))
    }
}

/// Nobody looks on.
impl<E> Observer<E> for () {}

/// Looks on after each step with a closure.
pub(crate) struct AfterEach<F>(pub(crate) F);

impl<E, F: FnMut(&mut Rollout<E>, &Tick) -> anyhow::Result<ControlFlow<()>>> Observer<E> for AfterEach<F> {
    fn after(&mut self, rollout: &mut Rollout<E>, tick: &Tick) -> anyhow::Result<ControlFlow<()>> {
        (self.0)(rollout, tick)
    }
}

impl Rollout {
    /// An episode in a house, at its start.
    pub(crate) fn in_house(house: House, instruction: String, grader: Option<Grader>, horizon: Option<u32>) -> Rollout {
        Rollout::new(HouseEnvironment::new(house, grader), instruction, horizon)
    }
}

impl<E: Environment> Rollout<E> {
    /// An episode at its start.
    pub(crate) fn new(env: E, instruction: String, horizon: Option<u32>) -> Rollout<E> {
        Rollout { env, instruction, horizon, ended_by: EndedBy::Grader, slot: 0, steps: 0, last: None }
    }

    /// How many steps were taken.
    pub(crate) fn steps(&self) -> u32 {
        self.steps
    }

    /// Goes back to the start, to be run again.
    ///
    /// # Errors
    /// When the environment fails.
    pub(crate) fn restart(&mut self) -> anyhow::Result<()> {
        (self.steps, self.last) = (0, None);
        self.env.reset()
    }

    /// The action that was taken last; `None` at the start.
    pub(crate) fn last(&self) -> Option<Action> {
        self.last
    }

    /// Goes on as if that action had led here.
    pub(crate) fn set_last(&mut self, last: Option<Action>) {
        self.last = last;
    }

    /// Goes on as if so many steps had been taken: the environment was brought to another state.
    pub(crate) fn set_steps(&mut self, steps: u32) {
        (self.steps, self.last) = (steps, None);
    }

    /// Whether it is over, and why.
    pub(crate) fn end(&self) -> Option<End> {
        if self.ended_by.is_grader() && self.env.grading().is_some_and(|(completed, of)| completed == of) {
            return Some(End::Success);
        }
        if self.env.own().is_some_and(|own| own.observation.done) {
            return Some(End::Environment);
        }
        self.horizon.is_some_and(|horizon| self.steps >= horizon).then_some(End::Timeout)
    }

    /// What a policy decides from now.
    pub(crate) fn observation(&mut self) -> Observation<'_> {
        Observation { environment: &mut self.env, instruction: &self.instruction, step: self.steps, last: self.last }
    }

    /// What `policy` would do now, without doing it.
    ///
    /// # Errors
    /// Whatever the policy reports.
    pub(crate) fn decide(&mut self, policy: &mut dyn Policy) -> anyhow::Result<Decision> {
        policy.act_in(self.slot, self.observation())
    }

    /// What the policy's critics say of the present state, in which it decided so; nothing without critics.
    ///
    /// # Errors
    /// Whatever the policy reports.
    pub(crate) fn values(&mut self, policy: &mut dyn Policy, decision: &Decision) -> anyhow::Result<Option<Values>> {
        match &decision.values {
            Some(values) => Ok(Some(values.clone())),
            None => policy.values(self.slot, &mut self.observation()),
        }
    }

    /// Takes one step that was decided.
    ///
    /// # Errors
    /// When the environment fails; an impossible action is an outcome.
    pub(crate) fn carry_out(&mut self, decision: Decision) -> anyhow::Result<Tick> {
        let action = decision.action;
        let transition = self.env.step(action)?;
        self.steps += 1;
        self.last = Some(action);
        let completed_one = transition.completed_subtask;
        let Transition { outcome, reward, .. } = transition;
        Ok(Tick { step: self.steps, decision, outcome, completed_one, reward })
    }

    /// Lets a policy act until the episode is over or `observer` ends it.
    ///
    /// # Errors
    /// Whatever policy, environment or observer report.
    pub(crate) fn run(&mut self, policy: &mut dyn Policy, observer: &mut dyn Observer<E>) -> anyhow::Result<()> {
        while self.end().is_none() {
            let decision = self.decide(policy)?;
            if observer.before(self, Some(policy), &decision)?.is_break() {
                break;
            }
            let tick = self.carry_out(decision)?;
            if observer.after(self, &tick)?.is_break() {
                break;
            }
        }
        Ok(())
    }

    /// Takes actions that were recorded, to the last of them or until `observer` ends it.
    ///
    /// # Errors
    /// Whatever environment or observer report.
    pub(crate) fn replay(
        &mut self,
        actions: impl IntoIterator<Item = Action>,
        observer: &mut dyn Observer<E>,
    ) -> anyhow::Result<()> {
        for action in actions {
            let decision = Decision::of(action);
            if observer.before(self, None, &decision)?.is_break() {
                break;
            }
            let tick = self.carry_out(decision)?;
            if observer.after(self, &tick)?.is_break() {
                break;
            }
        }
        Ok(())
    }
}

/// What `policy` would do in each of its slots, one rollout a slot.
///
/// # Errors
/// Where all slots fail together; a slot's own failure is in its place.
pub(crate) fn decide_all<E: Environment>(
    policy: &mut dyn Policy,
    rollouts: &mut [Option<Rollout<E>>],
) -> anyhow::Result<Decisions> {
    let mut observations: Vec<_> =
        rollouts.iter_mut().map(|rollout| rollout.as_mut().map(Rollout::observation)).collect();
    policy.act(&mut observations)
}
