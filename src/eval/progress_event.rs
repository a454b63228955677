//! How far an evaluation is, as a line of standard error for programs.

use serde::Serialize;

use super::evaluation::EvaluationProgress;

/// A line of standard error of `sprint eval --json`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(tag = "event", rename_all = "snake_case")]
pub(crate) enum ProgressEvent {
    /// An episode is over.
    Progress {
        /// The counts so far.
        progress: EvaluationProgress,
        /// Since the evaluation began.
        seconds: f64,
    },
}
