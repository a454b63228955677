//! Episodes: one rollout of a policy in a task, as runs record it.

use serde::{Deserialize, Serialize};

use super::failure::Failure;
use super::instruction_variant::InstructionVariant;
use super::rollout::{EndedBy, Rollout, Tick};
use super::wish::Wish;
use crate::agent::DecisionOverride;
use crate::domain::world::Instance;
use crate::domain::{Action, ActionType, Class};
use crate::env::Environment;
use crate::house::Outcome;

/// One line of a run's `episodes.jsonl`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Episode {
    /// The id of the task that was played.
    pub(crate) task: String,
    /// The episode's seed, one of the run's.
    pub(crate) seed: u64,
    /// How the instruction was derived from the task's own; the task's own where absent.
    #[serde(default, skip_serializing_if = "InstructionVariant::is_original")]
    pub(crate) variant: InstructionVariant,
    /// The subtask from which the agent acted; the expert did those before.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(crate) start_subtask: u32,
    /// Fingerprint of the world at the start.
    pub(crate) start_hash: String,
    /// The instruction at the start, as the agent got it.
    pub(crate) instruction: String,
    /// How many subtasks the agent completed.
    pub(crate) completed: u32,
    /// How many subtasks the agent had to complete.
    pub(crate) of: u32,
    /// Every subtask was completed.
    pub(crate) success: bool,
    /// How many actions the agent took.
    pub(crate) steps: u32,
    /// The sum of what its steps earned, where the environment tells.
    #[serde(rename = "return", default, skip_serializing_if = "Option::is_none")]
    pub(crate) earned: Option<f64>,
    /// Why it ended before its time, if it did: what the policy or the environment reported.
    pub(crate) error: Option<String>,
    /// What kept it from success, where it ended in its time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) failure: Option<Failure>,
    /// The agent ended it by its own end: whether everything that was asked held in that state. Only in runs in which the agent's
    /// word ends an episode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) agent_end: Option<bool>,
    /// How often it was begun; more than once where an error made it begin anew.
    #[serde(default = "once", skip_serializing_if = "is_one")]
    pub(crate) attempts: u32,
    /// How many of the trace's steps the expert took first.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(crate) prefix_steps: u32,
    /// What the agent was told, one after the other, and what came of each; only where a person explored, or a task that says
    /// no subtasks was read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) wishes: Vec<Wish>,
    /// What was done, step by step.
    pub(crate) trace: Vec<TraceStep>,
}

/// What tells the episodes of a run apart.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct EpisodeKey {
    /// The id of the task.
    pub(crate) task: String,
    /// One of the run's seeds.
    pub(crate) seed: u64,
    /// How the instruction was derived from the task's own.
    pub(crate) variant: InstructionVariant,
    /// The subtask from which the agent acts.
    pub(crate) start_subtask: u32,
}

impl std::fmt::Display for EpisodeKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "task {:?} and seed {}", self.task, self.seed)?;
        if !self.variant.is_original() {
            write!(f, " ({})", self.variant.name())?;
        }
        if self.start_subtask > 0 {
            write!(f, " from subtask {}", self.start_subtask)?;
        }
        Ok(())
    }
}

impl Episode {
    /// What tells it apart from others of its run.
    pub(crate) fn key(&self) -> EpisodeKey {
        EpisodeKey {
            task: self.task.clone(),
            seed: self.seed,
            variant: self.variant,
            start_subtask: self.start_subtask,
        }
    }

    /// Whether it was played as the task asks: from its start, with its own instruction.
    pub(crate) fn is_plain(&self) -> bool {
        self.variant.is_original() && self.start_subtask == 0
    }

    /// Whether a person explored it: its first step says who chose.
    pub(crate) fn is_explored(&self) -> bool {
        self.trace.first().is_some_and(|step| step.author.is_some())
    }

    /// What its record says of it that its own steps deny. A person who explored was told several things.
    pub(crate) fn contradiction(&self) -> Option<String> {
        if let Some(failure) = self.failure.filter(|_| self.success || self.error.is_some()) {
            let ended = if self.success { "a success" } else { "an error" };
            return Some(format!("failure: {}, of {ended}", failure.words()));
        }
        if self.trace.is_empty() || self.is_explored() {
            return None;
        }
        let own = self.trace.get(self.prefix_steps as usize..).unwrap_or_default();
        if self.steps as usize != own.len() {
            return Some(format!("steps: {}, but its trace has {}", self.steps, own.len()));
        }
        let completed = TraceStep::completed(own);
        (self.completed != completed).then(|| format!("completed: {}, but its trace says {completed}", self.completed))
    }

    /// Whether its own record makes it a success, where that word ended it.
    pub(crate) fn is_success(&self, ended_by: EndedBy) -> bool {
        let is_complete = self.error.is_none() && self.of > 0 && self.completed == self.of;
        is_complete && (ended_by.is_grader() || self.agent_end == Some(true))
    }

    /// The trace's steps that the agent took for what it was told at the start.
    pub(crate) fn own_steps(&self) -> &[TraceStep] {
        let first = (self.prefix_steps as usize).min(self.trace.len());
        // What was told before the first step was told at the start, too.
        let next = self.wishes.iter().skip(1).find(|wish| wish.began > 0);
        let told_else = next.map_or(self.trace.len(), |next| next.began as usize);
        &self.trace[first..told_else.clamp(first, self.trace.len())]
    }

    /// 1 for a success, else 0.
    pub(crate) fn succeeded(&self) -> f64 {
        f64::from(u8::from(self.success))
    }

    /// Completed subtasks as a share of those that were asked.
    pub(crate) fn progress(&self) -> f64 {
        f64::from(self.completed) / f64::from(self.of.max(1))
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_zero(number: &u32) -> bool {
    *number == 0
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_one(number: &u32) -> bool {
    *number == 1
}

fn once() -> u32 {
    1
}

/// One action of an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TraceStep {
    /// The action that was taken.
    #[serde(rename = "action", default = "own", skip_serializing_if = "is_own")]
    pub(crate) kind: ActionType,
    /// The action that was taken, where the environment's actions are its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) own: Option<RemoteStep>,
    /// The thing that it was done to, by its position in the scene or world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) target: Option<Instance>,
    /// The class of the target.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) class: Option<Class>,
    /// Whether it was carried out, or why it was impossible.
    pub(crate) outcome: Outcome,
    /// The subtask that it completed, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) subtask: Option<u32>,
    /// The instruction from this step on, where it changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) instruction: Option<String>,
    /// Who chose from this step on, where that changed; without any, the run's policy did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) author: Option<Author>,
}

/// A step in an environment whose actions are its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RemoteStep {
    /// The action's name.
    pub(crate) action: String,
    /// Its argument, where it takes one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) argument: Option<serde_json::Value>,
    /// What it earned, where the environment tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) reward: Option<f64>,
    /// Tells what was seen after it from anything else.
    pub(crate) seen: String,
}

/// The kind of an action that stands in [`RemoteStep`].
fn own() -> ActionType {
    ActionType::Own(0)
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_own(kind: &ActionType) -> bool {
    matches!(kind, ActionType::Own(_))
}

/// Who chose a step of an explored episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Author {
    /// `hand` for a person, else the policy's name.
    pub(crate) policy: String,
    /// SHA-256 of its checkpoint, where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) checkpoint: Option<String>,
    /// The seed of its chance.
    pub(crate) seed: u64,
    /// It drew its actions from its distribution instead of taking the likeliest.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) sampling: bool,
    /// What was asked of its decisions in place of what its checkpoint says.
    #[serde(default, skip_serializing_if = "DecisionOverride::is_none")]
    pub(crate) deciding: DecisionOverride,
}

impl Author {
    /// The name of a person who acts.
    pub(crate) const HAND: &str = "hand";

    /// A policy without a checkpoint that takes what is likeliest, and its seed.
    pub(crate) fn of(policy: &str, seed: u64) -> Author {
        Author { policy: policy.into(), checkpoint: None, seed, sampling: false, deciding: DecisionOverride::default() }
    }

    /// The author of what a person does.
    pub(crate) fn hand() -> Author {
        Author::of(Author::HAND, 0)
    }

    /// Whether a person chose, no policy.
    pub(crate) fn is_hand(&self) -> bool {
        self.policy == Author::HAND
    }
}

impl TraceStep {
    /// What was done, as an action that can be taken again in this environment.
    ///
    /// # Errors
    /// When its actions are its own, and it has this one no longer.
    pub(crate) fn action_in<E: Environment + ?Sized>(&self, environment: &E) -> anyhow::Result<Action> {
        match (&self.own, environment.own()) {
            (Some(step), Some(view)) => view.space.find(&step.action, step.argument.as_ref()),
            (Some(step), None) => anyhow::bail!("{} has no action {:?}", environment.name(), step.action),
            (None, Some(_)) => anyhow::bail!("{} has no action {}", environment.name(), self.kind),
            (None, None) => Ok(self.action()),
        }
    }

    /// What was done in House, as an action that can be taken again.
    pub(crate) fn action(&self) -> Action {
        Action { kind: self.kind, target: self.target }
    }

    /// How many subtasks these steps completed. Where an environment's actions are its own, one step may complete several.
    pub(crate) fn completed(steps: &[TraceStep]) -> u32 {
        let is_remote = steps.iter().any(|step| step.own.is_some());
        let mut completing = steps.iter().filter_map(|step| step.subtask);
        if is_remote { completing.max().map_or(0, |last| last + 1) } else { completing.by_ref().count() as u32 }
    }

    /// Whether the same was done, whatever came of it.
    pub(crate) fn is_same_action(&self, other: &TraceStep) -> bool {
        let named = |step: &TraceStep| step.own.as_ref().map(|own| (own.action.clone(), own.argument.clone()));
        (self.kind, self.target) == (other.kind, other.target) && named(self) == named(other)
    }

    /// What was done, in words, for whoever compares records.
    pub(crate) fn action_in_words(&self) -> String {
        match &self.own {
            None => format!("{:?}", self.action()),
            Some(RemoteStep { action, argument: None, .. }) => action.clone(),
            Some(RemoteStep { action, argument: Some(argument), .. }) => format!("{action} {argument}"),
        }
    }

    /// The record of a step that `rollout` just took.
    pub(crate) fn of<E: Environment>(tick: &Tick, rollout: &Rollout<E>) -> TraceStep {
        let action = tick.decision.action;
        let completed = rollout.env.grading().map_or(0, |(completed, _)| completed as u32);
        TraceStep {
            // The name says which; the place is this process's own.
            kind: if is_own(&action.kind) { own() } else { action.kind },
            own: rollout.env.own().and_then(|view| {
                let (name, argument) = view.space.parts(action)?;
                let seen = view.observation.digest.clone();
                Some(RemoteStep { action: name.to_owned(), argument, reward: tick.reward, seen })
            }),
            target: action.target.filter(|_| !is_own(&action.kind)),
            class: action.target.and_then(|target| rollout.env.class_of(target)),
            outcome: tick.outcome,
            subtask: tick.completed_one.then(|| completed.saturating_sub(1)),
            instruction: None,
            author: None,
        }
    }
}
