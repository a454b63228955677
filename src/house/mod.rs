//! House: the simulator. Rules, what is seen, graders, the expert, and generated floor plans.

pub mod outcome;
pub mod placing;
pub mod rules;
pub mod view;

pub use outcome::{Outcome, Reason};
