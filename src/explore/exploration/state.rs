//! What an exploration consists of, beside the house and the tree of what was tried.

use std::sync::Arc;

use crate::agent::registry::PolicyKind;
use crate::agent::{Decision, Policy, Values};
use crate::domain::Task;
use crate::domain::task::SceneRef;
use crate::episode::record::Author;
use crate::explore::session_file::SessionFile;
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
    /// Somebody was told or made to decide something else in the present state.
    pub(super) redirected: bool,
}

/// What is drawn of the present state.
#[derive(Default)]
pub(super) struct Frames {
    /// The present frame, once it was drawn.
    pub(super) present: Option<Arc<Frame>>,
    /// Snapshots hold the frames before the present one too.
    pub(super) looks_back: bool,
}

/// Where the session is kept, and what of it is there.
#[derive(Default)]
pub(super) struct Autosave {
    /// Of a session that was taken up, at first the one that it was in.
    pub(super) file: Option<SessionFile>,
    pub(super) written: Option<Progress>,
}

/// What there is to keep: it changes with every step and word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Progress {
    pub(super) episode: u32,
    pub(super) states: usize,
    pub(super) branches: usize,
    pub(super) told: u32,
    pub(super) branch: usize,
    pub(super) step: u32,
    pub(super) is_over: bool,
}

/// What is in no run folder yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Unsaved {
    /// Branches beside the first.
    pub(crate) branches: usize,
    /// Wishes that were typed.
    pub(crate) wishes: u32,
}

impl Unsaved {
    /// Whether there is anything.
    pub(crate) fn is_empty(self) -> bool {
        self == Unsaved::default()
    }

    /// How much it is, in words.
    pub(crate) fn words(self) -> String {
        let count = |many: usize, one: &str, more: &str| match many {
            0 => None,
            1 => Some(format!("1 {one}")),
            many => Some(format!("{many} {more}")),
        };
        let parts = [count(self.branches, "branch", "branches"), count(self.wishes as usize, "wish", "wishes")];
        parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
    }
}
