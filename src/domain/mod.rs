//! Ground floor: the words of the program as types. Plain data with serde; no IO, no rules.

pub(crate) mod action;
pub(crate) mod class;
pub mod environment_name;
pub(crate) mod place;
pub mod scene;
pub(crate) mod skill;
pub mod task;
pub(crate) mod trajectory;
pub mod world;

pub use action::{Action, ActionType};
pub use class::Class;
pub use environment_name::EnvironmentName;
pub use place::{Cell, Heading, Point, Pose};
pub use scene::{Fixture, Room, Scene};
pub use skill::{Goal, Role, SkillKind, Subtask};
pub use task::{Task, TaskSet};
pub use trajectory::Trajectory;
pub use world::{Instance, Object, Parent, World};
