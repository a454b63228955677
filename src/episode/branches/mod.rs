//! Branches: everything that was tried from one start, as a tree of steps. One branch is in hand, at one of its steps; a step
//! that was not taken there before grows a new branch, and the same step taken again follows the one that is there.

mod moment;
mod record;
mod taken;
mod tree;

pub use moment::{FRAMES, Moment, look_back};
pub use taken::Taken;
pub use tree::{Branch, Growth, Place, Tree};
