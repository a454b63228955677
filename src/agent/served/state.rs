//! What is carried from step to step of an episode that a policy server plays.

use rmpv::Value;

/// What a policy server carries from step to step, as far as it is known here.
#[derive(Clone, Debug, Default)]
pub struct ServedState {
    pub(super) seed: u64,
    /// Tells what the server has seen; 0 before the start of an episode.
    pub(super) version: u64,
    /// What the server gave to be given back at its next step.
    pub(super) carried: Option<Value>,
}
