//! Runs: episodes, evaluations, trainings, and the folders they write.

pub mod rollout;
pub mod stats;
