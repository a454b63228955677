//! What the program's exit code says.

use std::process::ExitCode;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ExitStatus {
    /// All went well.
    Ok,
    /// A threshold that the user set was missed.
    BelowThreshold,
    /// Some items failed; the rest is complete.
    SomeFailed,
    /// Stopped by a signal, with a valid partial result.
    Interrupted,
}

impl From<ExitStatus> for ExitCode {
    fn from(status: ExitStatus) -> ExitCode {
        ExitCode::from(match status {
            ExitStatus::Ok => 0,
            ExitStatus::BelowThreshold => 2,
            ExitStatus::SomeFailed => 3,
            ExitStatus::Interrupted => 130,
        })
    }
}
