//! Policies that read the task instead of the instruction.

pub mod expert;
pub mod scanning;
