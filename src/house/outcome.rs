//! What an action came to: done, or impossible for a reason that can be read aloud.

use serde::{Deserialize, Serialize};

use crate::domain::Class;

/// What an action came to. An impossible action leaves the world as it was.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// It was carried out.
    Done,
    /// It could not be.
    Impossible(Reason),
}

impl Outcome {
    /// Whether it was carried out.
    pub fn is_done(self) -> bool {
        self == Outcome::Done
    }
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Outcome::Done => f.write_str("ok"),
            Outcome::Impossible(reason) => reason.fmt(f),
        }
    }
}

/// Why an action was impossible.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, thiserror::Error, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Reason {
    #[error("something is in the way")]
    Blocked,
    #[error("the environment refused it")]
    Refused,
    #[error("the camera cannot look further up")]
    HighestLook,
    #[error("the camera cannot look further down")]
    LowestLook,
    #[error("the action needs an object")]
    NoTarget,
    #[error("there is no such object")]
    UnknownTarget,
    #[error("the {0} is not in view")]
    NotVisible(Class),
    #[error("the {class} is too far away ({} m)", f64::from(*.millimetres) / 1000.0)]
    TooFar { class: Class, millimetres: i32 },
    #[error("the {inside} is shut in the {container}")]
    ShutIn { inside: Class, container: Class },
    #[error("the {0} is in the hand")]
    InHand(Class),
    #[error("the hand already holds the {0}")]
    HandFull(Class),
    #[error("the hand is empty")]
    HandEmpty,
    #[error("the {0} cannot be picked up")]
    NotPickupable(Class),
    #[error("the {0} holds nothing")]
    NotReceptacle(Class),
    #[error("the {0} cannot be opened")]
    NotOpenable(Class),
    #[error("the {0} is open")]
    AlreadyOpen(Class),
    #[error("the {0} is closed")]
    Closed(Class),
    #[error("the {0} is running")]
    Running(Class),
    #[error("the {0} has no switch")]
    NotToggleable(Class),
    #[error("the {0} is already on")]
    AlreadyOn(Class),
    #[error("the {0} is already off")]
    AlreadyOff(Class),
    #[error("the {0} cannot be sliced")]
    NotSliceable(Class),
    #[error("the {0} is already sliced")]
    AlreadySliced(Class),
    #[error("slicing needs a knife in the hand")]
    NeedsKnife,
    #[error("there is no room for the {content} in the {receptacle}")]
    NoRoom { content: Class, receptacle: Class },
}
