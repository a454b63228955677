//! House: the simulator. Rules, what is seen, graders, the expert, and generated floor plans.

pub(crate) mod bounds;
pub(crate) mod camera;
pub(crate) mod doors;
pub mod expert;
pub(crate) mod extent;
pub mod generate;
pub(crate) mod goals;
pub mod grading;
pub(crate) mod occlusion;
pub(crate) mod outcome;
pub(crate) mod placing;
pub mod render;
pub(crate) mod replay;
pub mod rules;
pub mod session;
#[cfg(test)]
pub(crate) mod testing;
pub mod validate;
pub mod view;

pub(crate) use outcome::{Outcome, Reason};
pub(crate) use replay::Replay;
pub use session::House;
