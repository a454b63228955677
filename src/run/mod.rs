//! Runs: episodes, evaluations, trainings, and the folders they write.

pub mod replay;
pub mod rollout;
