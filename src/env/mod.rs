//! What an agent acts in: the trait that everything above knows an environment by, and House behind it.

pub mod environment;
pub mod goal_frames;
pub mod house;

pub use environment::{Environment, HouseAccess, Snapshot, Transition};
pub use goal_frames::goal_frames;
pub use house::HouseEnvironment;
