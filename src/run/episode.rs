//! Episodes: one rollout of a policy in a task, as runs record it.

use serde::{Deserialize, Serialize};

use super::rollout::{Rollout, Tick};
use crate::agent::Policy;
use crate::domain::world::Instance;
use crate::domain::{ActionType, Class};
use crate::house::Outcome;

/// One line of a run's `episodes.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Episode {
    /// The task's id.
    pub task: String,
    /// Which of the run's seeds.
    pub seed: u64,
    /// Fingerprint of the world at the start.
    pub start_hash: String,
    /// What the agent was told.
    pub instruction: String,
    /// How many subtasks were completed.
    pub completed: u32,
    /// Of how many.
    pub of: u32,
    /// All were.
    pub success: bool,
    /// How many actions were taken.
    pub steps: u32,
    /// Why it ended before its time, if it did: what the policy or the environment reported.
    pub error: Option<String>,
    /// What was done, step by step.
    pub trace: Vec<Step>,
}

/// One action of an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// What was done.
    #[serde(rename = "do")]
    pub kind: ActionType,
    /// To what.
    #[serde(rename = "to", default, skip_serializing_if = "Option::is_none")]
    pub target: Option<Instance>,
    /// The target's class.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<Class>,
    /// What it came to.
    pub outcome: Outcome,
    /// The subtask that it completed, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subtask: Option<u32>,
    /// What the agent was told from this step on, where that changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub told: Option<String>,
    /// Who chose from this step on, where that changed; without any, the run's policy did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Author>,
}

/// Who chose a step of an explored episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Author {
    /// `hand` for a person, else the policy's name.
    pub policy: String,
    /// SHA-256 of its checkpoint, where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<String>,
    /// The seed of its chance.
    pub seed: u64,
    /// It drew its actions by chance instead of taking the likeliest.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub samples: bool,
}

impl Author {
    /// The name of a person who acts.
    pub const HAND: &str = "hand";

    /// A person.
    pub fn hand() -> Author {
        Author { policy: Author::HAND.into(), checkpoint: None, seed: 0, samples: false }
    }

    /// Whether a person chose.
    pub fn is_hand(&self) -> bool {
        self.policy == Author::HAND
    }
}

impl Step {
    /// The record of a step that `rollout` just took.
    pub fn of(tick: &Tick, rollout: &Rollout) -> Step {
        let (action, house) = (tick.decision.action, &rollout.house);
        let completed = rollout.grader.as_ref().map_or(0, |grader| grader.completed() as u32);
        Step {
            kind: action.kind,
            target: action.target,
            class: action.target.and_then(|target| house.world().class_of(house.scene(), target)),
            outcome: tick.outcome,
            subtask: tick.completed_one.then(|| completed.saturating_sub(1)),
            told: None,
            by: None,
        }
    }
}

/// Lets `policy` act until the episode is over; `trace` grows as it goes, so that it survives a panic.
///
/// # Errors
/// Whatever the policy reports.
pub fn play(rollout: &mut Rollout, policy: &mut dyn Policy, trace: &mut Vec<Step>) -> anyhow::Result<()> {
    while rollout.end().is_none() {
        let tick = rollout.step(policy)?;
        trace.push(Step::of(&tick, rollout));
    }
    Ok(())
}
