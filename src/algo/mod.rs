//! Algorithms: how a policy learns from trajectories.

pub mod adamw;
pub mod batch;
pub mod bc;
pub mod chain;
pub mod critic;
pub mod iql;
pub mod learner;
pub mod loss_terms;
pub mod policy_extraction;
pub mod schedule;
pub mod update;
