//! What can be asked of a session.

use std::path::PathBuf;

use super::step_rate::StepRate;
use crate::agent::registry::PolicyKind;
use crate::analysis::chain::Draws;
use crate::domain::Action;
use crate::explore::breakpoints::Condition;

/// What can be asked of a session.
#[derive(Clone, Debug, PartialEq)]
pub enum SessionCommand {
    /// Go on step after step.
    Run {
        /// Along the recording, or as the policy chooses.
        mode: RunMode,
        /// Where this run alone stops, beside the breakpoints.
        until: Option<Condition>,
    },
    /// No longer go on by itself.
    Pause,
    /// One step by the policy's choice.
    Step,
    /// One step that a person chose.
    Act(Action),
    /// Tell the agent something else.
    Instruct(String),
    /// The wish in force is fulfilled, or it failed, a person says.
    Say {
        /// It is fulfilled.
        fulfilled: bool,
    },
    /// The wish in force is meant as another of its readings: that of a number from 1, or the next.
    Mean(Option<usize>),
    /// Back to the start, with the present instruction.
    Reset,
    /// The next house or task.
    Next,
    /// The house of that seed, or the task of that number.
    Seed(u64),
    /// A policy of that kind decides from here on.
    Choose(PolicyKind),
    /// Another checkpoint becomes the agent, by name or number.
    Checkpoint(String),
    /// The policy's actions are drawn by chance, with that seed.
    Sample(u64),
    /// The likeliest actions again, with the episode's own seed.
    Greedy,
    /// How fast runs go on.
    StepRate(StepRate),
    /// To a step of the branch in hand, or to its end.
    Seek(u32),
    /// So many steps along the branch in hand.
    Along {
        /// Forward, or back.
        by: i32,
        /// At its end, forward is a step of the policy.
        steps: bool,
    },
    /// To the next event on the branch, or the one before.
    SeekEvent {
        /// To the next one.
        forward: bool,
    },
    /// To the completion of that subtask, from 1.
    SeekSubtask(u32),
    /// To the branch of that name or number.
    Switch(String),
    /// To the branch after the one in hand, around.
    NextBranch,
    /// Another name for the branch in hand.
    Rename(String),
    /// How the branch of that name or number and the one in hand part.
    Diverge(String),
    /// Runs stop where that holds, or no longer if they did; without a condition, nowhere.
    Break(Option<Condition>),
    /// Where runs stop.
    Breakpoints,
    /// The steps of the branch in hand, in words.
    Actions,
    /// A link of the last chain as a branch, at the state in which it began; from 0.
    OpenLink(usize),
    /// The instruction in force and another, in this state.
    Compare(String),
    /// Adopt the other instruction of the last comparison, and compare it with the one before.
    Swap,
    /// The value of every cell for the instruction in force.
    ValueMap,
    /// No value map is computed any more; other work in the background goes on.
    StopValueMap,
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
    /// A few wishes that can be fulfilled in this house.
    Examples,
    /// Whether snapshots hold the frames before the present one.
    LookBack(bool),
    /// The present state.
    Show,
    /// The place on the branch in hand.
    Where,
    /// What the policy would do next.
    Decide,
}

/// By what a session goes on by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunMode {
    /// Along what was recorded, to its end.
    Replay,
    /// As the policy chooses.
    Policy,
    /// As the policy chooses, so many steps at full speed.
    Steps(u32),
}
