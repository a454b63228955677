//! What an exploration consists of, beside the house and the tree of what was tried.

use std::sync::Arc;

use crate::agent::registry::PolicyKind;
use crate::agent::{Decision, Policy, Values};
use crate::domain::Task;
use crate::domain::task::SceneRef;
use crate::episode::record::Author;
use crate::house::view::Frame;

/// Which episode it is, and what it began with.
pub(super) struct CurrentEpisode {
    /// Counts the episodes of this session, from 1.
    pub(super) number: u32,
    /// The seed of the house, or of the episode's chance.
    pub(super) seed: u64,
    /// What is asked, whether it still applies or not.
    pub(super) task: Option<Task>,
    /// How tasks refer to the floor plan.
    pub(super) reference: SceneRef,
    /// It ends at the task's horizon.
    pub(super) limited: bool,
    /// Instructions that make sense in this house.
    pub(super) examples: Arc<Vec<String>>,
}

/// The policy that decides, and what it decided here.
pub(super) struct ActingPolicy {
    pub(super) kind: PolicyKind,
    /// `None` until it is loaded.
    pub(super) policy: Option<Box<dyn Policy>>,
    /// Its name, hash and chance, as steps record them.
    pub(super) author: Author,
    /// What it decided in the present state, once it was asked.
    pub(super) decision: Option<(Decision, Option<Values>)>,
}

/// What is drawn of the present state.
#[derive(Default)]
pub(super) struct Frames {
    /// The present frame, once it was drawn.
    pub(super) present: Option<Arc<Frame>>,
    /// Snapshots hold the frames before the present one too.
    pub(super) looks_back: bool,
}
