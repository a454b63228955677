//! How a session goes on by itself, and where it stops.

use super::command::RunMode;
use super::step_rate::StepRate;
use crate::explore::breakpoints::{Condition, Facts};

/// How a session goes on by itself, and where it stops.
#[derive(Default)]
pub(super) struct Run {
    pub(super) mode: Option<RunMode>,
    pub(super) rate: StepRate,
    /// Where every run stops.
    pub(super) breakpoints: Vec<Condition>,
    /// Where this run alone stops.
    pub(super) until: Option<Condition>,
    /// The branch and step at which the agent was last heard to say that it is done.
    pub(super) heard: Option<(usize, u32)>,
    /// A run came to the end of its wish here: the next wish runs on.
    pub(super) resumes: bool,
}

impl Run {
    /// Why the run stops, one step after `before`.
    pub(super) fn stops(&self, before: &Facts, now: &Facts) -> Option<String> {
        self.breakpoints.iter().chain(&self.until).find_map(|condition| condition.hit(before, now))
    }

    pub(super) fn has_conditions(&self) -> bool {
        self.mode.is_some() && (self.until.is_some() || !self.breakpoints.is_empty())
    }
}
