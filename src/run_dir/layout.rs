//! The files of a run folder.

/// What the run was made from.
pub const MANIFEST: &str = "manifest.json";
/// The episodes, one a line, appended as they end.
pub const EPISODES: &str = "episodes.jsonl";
/// The tasks that the run plays.
pub const TASKS: &str = "tasks.json";
/// The figures of the whole run.
pub const SUMMARY: &str = "summary.json";
