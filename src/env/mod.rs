//! What an agent acts in: the trait that everything above knows an environment by, and House behind it.

pub(crate) mod environment;
pub(crate) mod goal_frames;
pub(crate) mod house;

pub(crate) use environment::{Environment, HouseAccess};
pub(crate) use goal_frames::goal_frames;
pub(crate) use house::HouseEnvironment;
