//! The 12 low-level actions of ALFRED-RL.

use serde::{Deserialize, Serialize};

use super::world::Instance;

/// The kind of a low-level action: five to move about, seven that act on an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[allow(missing_docs)]
pub enum ActionType {
    MoveAhead,
    RotateLeft,
    RotateRight,
    LookUp,
    LookDown,
    Pickup,
    Put,
    Open,
    Close,
    ToggleOn,
    ToggleOff,
    Slice,
    /// An action of an environment's own, by its place in that environment's action space; House has none.
    #[serde(skip)]
    Own(u16),
}

impl ActionType {
    /// In the order of the policy's action head.
    pub const ALL: [ActionType; 12] = [
        ActionType::MoveAhead,
        ActionType::RotateLeft,
        ActionType::RotateRight,
        ActionType::LookUp,
        ActionType::LookDown,
        ActionType::Pickup,
        ActionType::Put,
        ActionType::Open,
        ActionType::Close,
        ActionType::ToggleOn,
        ActionType::ToggleOff,
        ActionType::Slice,
    ];
    /// Entries of the policy's action head.
    pub const COUNT: usize = Self::ALL.len();

    /// Position in the action head; those of an environment's own lie behind it.
    pub(crate) fn index(self) -> usize {
        match self {
            ActionType::MoveAhead => 0,
            ActionType::RotateLeft => 1,
            ActionType::RotateRight => 2,
            ActionType::LookUp => 3,
            ActionType::LookDown => 4,
            ActionType::Pickup => 5,
            ActionType::Put => 6,
            ActionType::Open => 7,
            ActionType::Close => 8,
            ActionType::ToggleOn => 9,
            ActionType::ToggleOff => 10,
            ActionType::Slice => 11,
            ActionType::Own(place) => ActionType::COUNT + usize::from(place),
        }
    }

    /// The kind at that position of the action head.
    pub fn from_index(index: usize) -> Option<ActionType> {
        Self::ALL.get(index).copied()
    }

    /// Whether it acts on an object.
    pub fn is_interaction(self) -> bool {
        !matches!(self, ActionType::Own(_)) && self.index() >= ActionType::Pickup.index()
    }

    /// The name as the screens show it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            ActionType::MoveAhead => "MoveAhead",
            ActionType::RotateLeft => "RotateLeft",
            ActionType::RotateRight => "RotateRight",
            ActionType::LookUp => "LookUp",
            ActionType::LookDown => "LookDown",
            ActionType::Pickup => "Pickup",
            ActionType::Put => "Put",
            ActionType::Open => "Open",
            ActionType::Close => "Close",
            ActionType::ToggleOn => "ToggleOn",
            ActionType::ToggleOff => "ToggleOff",
            ActionType::Slice => "Slice",
            // Its name stands in the environment's action space.
            ActionType::Own(_) => "own action",
        }
    }
}

impl std::fmt::Display for ActionType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// A low-level action: its kind and, for an interaction, the instance it acts on (the receptacle, for a Put).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Action {
    /// What is done.
    #[serde(rename = "do")]
    pub kind: ActionType,
    /// To what; `None` for the five navigation actions.
    #[serde(rename = "to", default, skip_serializing_if = "Option::is_none")]
    pub target: Option<Instance>,
}

impl Action {
    /// An action without a target.
    pub fn navigate(kind: ActionType) -> Action {
        Action { kind, target: None }
    }

    /// An action of an environment's own: its place in the action space, and the place of its argument where it takes one.
    pub(crate) fn own(place: u16, argument: Option<u16>) -> Action {
        Action { kind: ActionType::Own(place), target: argument.map(Instance::Object) }
    }

    /// The places of an action of an environment's own, and of its argument.
    pub(crate) fn as_own(self) -> Option<(u16, Option<u16>)> {
        let ActionType::Own(place) = self.kind else { return None };
        let argument = self.target.map(|target| match target {
            Instance::Object(at) | Instance::Fixture(at) => at,
        });
        Some((place, argument))
    }

    /// An interaction with `target`.
    pub fn interact(kind: ActionType, target: Instance) -> Action {
        Action { kind, target: Some(target) }
    }
}
