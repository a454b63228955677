//! Algorithms: how a policy learns from trajectories.

pub(crate) mod adamw;
pub(crate) mod batch;
pub(crate) mod bc;
pub mod chain;
pub(crate) mod critic;
pub(crate) mod iql;
pub(crate) mod learner;
pub(crate) mod loss_terms;
pub(crate) mod policy_extraction;
pub(crate) mod schedule;
pub mod update;
