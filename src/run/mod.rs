//! Runs: episodes, evaluations, trainings, and the folders they write.

pub mod cloning;
pub mod footage;
pub mod presets;
pub mod pretrain;
pub mod progress;
pub mod replay;
pub mod rollout;
pub mod sights;
pub mod visual_training;
