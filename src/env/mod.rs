//! What an agent acts in: the trait that everything above knows an environment by, and House behind it.

pub mod environment;
pub mod house;

pub use environment::{Environment, Snapshot, Transition};
pub use house::HouseEnvironment;
