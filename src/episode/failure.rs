//! The classes of why an episode fell short.

use serde::{Deserialize, Serialize};

/// What kept an episode from success; the first that applies, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Failure {
    /// A later subtask was done while its turn had not come.
    OutOfOrder,
    /// The right kind of interaction with a thing that was not asked for.
    WrongObject,
    /// The right thing, but not what was to be done with it.
    WrongAction,
    /// At the end the agent turned on the spot or pushed against something.
    Stuck,
    /// The thing was never in view and in reach.
    NeverReached,
    /// None of these: the thing was in reach and the time ran out.
    Timeout,
    /// The agent said that it was done, and was not.
    StoppedEarly,
    /// Everything was done, and the agent undid some of it before it said so.
    Undone,
    /// Everything was done, and the agent never said so.
    NeverStopped,
}

impl Failure {
    /// The class in words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Failure::OutOfOrder => "out of order",
            Failure::WrongObject => "wrong object",
            Failure::WrongAction => "right object, wrong action",
            Failure::Stuck => "stuck",
            Failure::NeverReached => "never reached the object",
            Failure::Timeout => "timeout",
            Failure::StoppedEarly => "said done too early",
            Failure::Undone => "done, and undone again",
            Failure::NeverStopped => "done, and never said so",
        }
    }
}
