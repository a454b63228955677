//! House: the simulator. Rules, what is seen, graders, the expert, and generated floor plans.

pub mod bounds;
pub mod camera;
pub mod doors;
pub mod expert;
pub mod extent;
pub mod generate;
pub mod goals;
pub mod grading;
pub mod occlusion;
pub mod outcome;
pub mod placing;
pub mod render;
pub mod replay;
pub mod rules;
pub mod session;
#[cfg(test)]
pub mod testing;
pub mod validate;
pub mod view;

pub use outcome::{Outcome, Reason};
pub use replay::Replay;
pub use session::House;
