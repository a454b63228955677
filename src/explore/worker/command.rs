//! What the screen asks of the worker.

use std::path::PathBuf;

use super::Pace;
use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Draws;
use crate::domain::Action;
use crate::explore::breakpoints::Condition;

/// What the screen asks of the worker.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Go on by itself in that way, or stop.
    Go(Option<Going>),
    /// One step by the policy's choice.
    Step,
    /// No value map is computed any more; other work in the background goes on.
    StopSurvey,
    /// One step that a person chose.
    Act(Action),
    /// Tell the agent something else.
    Instruct(String),
    /// Back to the start.
    Reset,
    /// The next house or task.
    Next,
    /// The house of that seed.
    Seed(u64),
    /// Another policy.
    Choose(PolicyKind),
    /// Another checkpoint.
    Checkpoint(String),
    /// Another chance for the policy; whether its actions are drawn.
    Reseed(u64, bool),
    /// How fast it runs.
    Pace(Pace),
    /// To a step of the branch in hand.
    Seek(u32),
    /// So many steps along the branch in hand.
    Along {
        /// Forward, or back.
        by: i32,
        /// At its end, forward is a step of the policy.
        steps: bool,
    },
    /// To the branch of that name or number.
    Switch(String),
    /// Another name for the branch in hand.
    Rename(String),
    /// How the branch of that name or number and the one in hand part.
    Diverge(String),
    /// Where runs stop.
    Break(Vec<Condition>),
    /// Run until that holds.
    Until(Condition),
    /// The instruction in force and another, in this state.
    Compare(String),
    /// The value of every cell for the instruction in force.
    Survey,
    /// Follow a chain; empty for the task's own.
    Chain(String),
    /// Which link of the last chain breaks, with so many draws of all links or one.
    WhichLink(Draws),
    /// The last chain once more, by another policy: the expert, chance, or a checkpoint by name or number.
    Against(String),
    /// Stop work in the background.
    Stop,
    /// Write what was explored as a run, into that folder or a new one.
    Save(Option<PathBuf>),
    /// Add the present state as a task to a file.
    SaveTask(PathBuf),
    /// Write the branch in hand in the form that the file's ending asks for.
    Export(PathBuf),
    /// Whether snapshots hold the frames before the present one.
    LookBack(bool),
}

/// How it goes on by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Going {
    /// Along what was recorded, to its end.
    Replay,
    /// As the policy chooses.
    Policy,
    /// As the policy chooses, so many steps at full speed.
    Steps(u32),
}
