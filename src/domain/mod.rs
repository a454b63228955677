//! Ground floor: the words of the program as types. Plain data with serde; no IO, no rules.

pub mod action;
pub mod class;
pub mod place;
pub mod scene;
pub mod skill;
pub mod task;
pub mod trajectory;
pub mod world;

pub use action::{Action, ActionType};
pub use class::Class;
pub use place::{Cell, Heading, Point, Pose};
pub use scene::{Fixture, Room, Scene};
pub use skill::{Goal, Role, SkillKind, Subtask};
pub use task::{Task, TaskSet};
pub use trajectory::Trajectory;
pub use world::{Instance, Object, Parent, World};
