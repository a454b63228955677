//! Algorithms: how a policy learns from trajectories.

pub mod adamw;
pub mod batch;
pub mod bc;
pub mod chain;
pub mod critic;
pub mod extraction;
pub mod iql;
pub mod learner;
pub mod schedule;
pub mod terms;
pub mod update;
