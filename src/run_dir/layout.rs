//! The files of a run folder.

/// What the run was made from.
pub(crate) const MANIFEST: &str = "manifest.json";
/// The episodes, one a line, appended as they end.
pub(crate) const EPISODES: &str = "episodes.jsonl";
/// Where policies were that are none of the program's own.
pub(crate) const POLICIES: &str = "policies.json";
/// The tasks that the run plays.
pub(crate) const TASKS: &str = "tasks.json";
/// The figures of the whole run.
pub(crate) const SUMMARY: &str = "summary.json";
