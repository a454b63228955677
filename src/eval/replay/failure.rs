//! What a replay found otherwise than recorded.

use serde::Serialize;

/// A check that one demonstration, or task of an official set, did not pass.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ReplayFailure {
    /// `legal`, `seen`, `goals`, `skills_class`, `skills_strict`; for a task of an official set, `task_class` or `task_strict`.
    pub(crate) what: &'static str,
    /// The id of the trajectory or task.
    pub(crate) id: String,
    /// What the simulator found instead.
    pub(crate) reason: String,
}
