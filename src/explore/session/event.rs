//! What a session tells whoever drives it.

use std::sync::Arc;

use super::command::RunMode;
use crate::agent::registry::PolicyKind;
use crate::agent::{Decision, Values};
use crate::analysis::instruction_ab::Contrast;
use crate::analysis::value_map::ValueMap;
use crate::episode::wish::Wish;
use crate::explore::breakpoints::Condition;
use crate::explore::chain_report::ChainReport;
use crate::explore::exploration::{SessionSnapshot, StepTaken};
use crate::explore::timeline::{ActionLine, BranchPosition, Divergence};

/// Takes in what a session tells, from its own thread and from those that compute in the background.
pub(crate) type EventSink = Arc<dyn Fn(SessionEvent) + Send + Sync>;

/// What a session tells whoever drives it.
#[derive(Clone, Debug)]
pub enum SessionEvent {
    /// The present state.
    State(Box<SessionSnapshot>),
    /// A step was taken.
    Stepped(Box<StepTaken>),
    /// What the policy would do next, with the action in words, and what its critics say.
    Decided(Decision, String, Option<Values>),
    /// It goes on by itself, or no longer.
    Running(Option<RunMode>),
    /// Something slow goes on (or nothing any more).
    Busy(Option<String>),
    /// The instruction changed, and what that means.
    Instructed {
        /// What the agent was told.
        old: String,
        /// What it is told now.
        new: String,
        /// What that means for the task.
        note: &'static str,
    },
    /// Another policy decides.
    PolicyChosen(PolicyKind),
    /// The checkpoint of that name decides.
    CheckpointChosen(String),
    /// Actions are drawn with that seed; without one, the likeliest are taken.
    Sampling(Option<u64>),
    /// Another place on the branches is in hand.
    At(BranchPosition),
    /// How what was told is understood.
    Read(Arc<Wish>),
    /// The agent says that it is done; the grader does not, or there is none.
    AgentDone {
        /// The wish in force.
        wish: Arc<Wish>,
        /// How likely that is by the agent's own end.
        likely: f32,
        /// How many subtasks the grader has done, and of how many; nothing where nobody grades the wish.
        graded: Option<(usize, usize)>,
    },
    /// The wish in force is over.
    Ended(Arc<Wish>),
    /// Nothing was done, because the wish in force is over.
    AlreadyOver(Arc<Wish>),
    /// A condition stopped the run.
    Stopped(String),
    /// Where runs stop.
    Breakpoints(Vec<Condition>),
    /// The steps of the branch in hand.
    Actions(Vec<ActionLine>),
    /// How two branches part.
    Diverged(Divergence),
    /// What two instructions come to.
    Compared(Box<Contrast>),
    /// The values of the cells so far, in the house as it was at that step.
    ValueMap(Arc<ValueMap>, u32),
    /// A chain so far.
    Chain(Box<ChainReport>),
    /// Wishes that can be fulfilled in this house.
    Examples(Vec<String>),
    /// Work in the background, with how far it is; nothing when it is over.
    Working(Option<String>),
    /// Something went well and is worth a line.
    Noted(String),
    /// Something could not be done; the episode itself goes on.
    Refused(String),
    /// The policy cannot go on.
    Failed(String),
}
