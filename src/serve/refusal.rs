//! Requests that are answered with an error.

/// A request that was not carried out. It has changed nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub(super) struct Refusal {
    pub(super) code: ErrorCode,
    pub(super) message: String,
}

/// OpenEnv's kinds of errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub(super) enum ErrorCode {
    InvalidJson,
    UnknownType,
    ValidationError,
    ExecutionError,
    CapacityReached,
}

impl Refusal {
    /// The request itself is wrong.
    pub(super) fn invalid(message: impl Into<String>) -> Refusal {
        Refusal { code: ErrorCode::ValidationError, message: message.into() }
    }

    /// It cannot be carried out now.
    pub(super) fn failed(message: impl Into<String>) -> Refusal {
        Refusal { code: ErrorCode::ExecutionError, message: message.into() }
    }
}

impl From<anyhow::Error> for Refusal {
    fn from(error: anyhow::Error) -> Refusal {
        Refusal::failed(format!("{error:#}"))
    }
}
