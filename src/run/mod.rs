//! Runs: episodes, evaluations, trainings, and the folders they write.

pub mod episode;
pub mod evaluate;
pub mod folder;
pub mod page;
pub mod replay;
pub mod report;
pub mod rollout;
pub mod scenes;
pub mod stats;
pub mod tasks;
pub mod threshold;

pub use evaluate::evaluate;
