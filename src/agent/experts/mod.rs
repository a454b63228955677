//! Policies that read the task instead of the instruction.

pub(crate) mod expert;
pub(crate) mod scanning;
