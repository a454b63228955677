//! What the worker tells the screen.

use std::sync::Arc;

use super::Going;
use crate::agent::{Decision, Values};
use crate::analysis::instruction_ab::Contrast;
use crate::analysis::value_map::ValueMap;
use crate::episode::rollout::End;
use crate::explore::chained::Chained;
use crate::explore::session::{Event, Snapshot};
use crate::explore::timeline::Divergence;

/// What the worker tells the screen.
#[derive(Clone, Debug)]
pub enum Report {
    /// The present state.
    Seen(Box<Snapshot>),
    /// A step was taken.
    Stepped(Event),
    /// What the policy would do next, with the action in words, and what its critics say.
    Thought(Decision, String, Option<Values>),
    /// It goes on by itself, or no longer.
    Going(Option<Going>),
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
    /// The episode is over.
    Ended(End),
    /// A condition stopped the run.
    Stopped(String),
    /// How two branches part.
    Diverged(Divergence),
    /// What two instructions come to.
    Compared(Box<Contrast>),
    /// The values of the cells so far, in the house as it was at that step.
    Surveyed(Arc<ValueMap>, u32),
    /// A chain so far.
    Chained(Box<Chained>),
    /// Work in the background, with how far it is; nothing when it is over.
    Working(Option<String>),
    /// Something went well and is worth a line.
    Noted(String),
    /// Something could not be done; the episode itself goes on.
    Refused(String),
    /// The policy cannot go on.
    Failed(String),
}
