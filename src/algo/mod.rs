//! Algorithms: how a policy learns from trajectories.

pub mod adamw;
pub mod bc;
pub mod learner;
pub mod schedule;
