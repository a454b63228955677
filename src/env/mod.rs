//! What an agent acts in: the trait that everything above knows an environment by; behind it House, and environments in another
//! process, whose actions are their own. Why an episode failed, chains, value maps and collecting demonstrations are about House.

pub(crate) mod action_space;
pub(crate) mod environment;
pub(crate) mod goal_frames;
pub(crate) mod house;
pub(crate) mod observation;
pub(crate) mod remote_view;
pub(crate) mod remote;

pub(crate) use environment::{Environment, HouseAccess};
pub(crate) use goal_frames::goal_frames;
pub(crate) use house::HouseEnvironment;
