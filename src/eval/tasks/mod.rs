//! Task sets: sampled, and checked.

pub mod check;
pub mod remote;
pub mod sample;
pub(crate) mod scene_folder;
