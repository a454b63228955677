//! Branches: everything that was tried from one start, as a tree of steps. One branch is in hand, at one of its steps; a step
//! that was not taken there before grows a new branch, and the same step taken again follows the one that is there.

mod saved_state;
mod record;
mod taken_step;
mod tree;

pub(crate) use saved_state::{FRAMES, SavedState, look_back};
pub(crate) use taken_step::TakenStep;
pub(crate) use tree::{Branch, Growth, Tree};
