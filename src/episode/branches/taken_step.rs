//! A step that was taken, with the distribution behind it.

use std::sync::Arc;

use crate::agent::{Decision, Values};
use crate::episode::record::{Author, TraceStep};
use crate::episode::wish::Wish;

#[derive(Clone, Debug)]
pub(crate) struct TakenStep {
    /// What was decided, and the distribution behind it.
    pub(crate) decision: Decision,
    /// What was recorded of it; `told` and `by` are left out, they follow from the neighbours.
    pub(crate) step: TraceStep,
    /// What the agent was told.
    pub(crate) instruction: Arc<str>,
    /// For which wish it was taken; only where a person explores.
    pub(crate) wish: Option<Arc<Wish>>,
    /// Who chose.
    pub(crate) author: Author,
    /// What the critics made of the state before it.
    pub(crate) values: Option<Values>,
}

impl TakenStep {
    /// Whether another step is the same choice: then it led to the same state.
    pub(crate) fn is_same(&self, other: &TakenStep) -> bool {
        self.decision.action == other.decision.action
            && self.instruction == other.instruction
            && self.author == other.author
            && match (&self.wish, &other.wish) {
                (Some(wish), Some(other)) => wish.is_same(other),
                (wish, other) => wish.is_none() && other.is_none(),
            }
    }
}
