//! Task sets: sampled, and checked.

pub mod check;
pub mod elsewhere;
pub mod sample;
