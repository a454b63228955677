//! Algorithms: how a policy learns from trajectories.

pub mod adamw;
pub mod bc;
pub mod chain;
pub mod iql;
pub mod learner;
pub mod schedule;
pub mod update;
