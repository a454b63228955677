//! The error that no further episode can do anything about.

/// The policy server cannot be reached any more.
#[derive(Debug, thiserror::Error)]
#[error("the policy server at {address} is gone ({why}): start it again")]
pub(crate) struct ServerGone {
    pub(super) address: String,
    pub(super) why: String,
}
