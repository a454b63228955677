//! Runs: episodes, evaluations, trainings, and the folders they write.

pub mod appraise;
pub mod branches;
pub mod card;
pub mod cloning;
pub mod chain;
pub mod collect;
pub mod contrast;
pub mod episode;
pub mod evaluate;
pub mod explored;
pub mod export;
pub mod folder;
pub mod footage;
pub mod landscape;
pub mod page;
pub mod presets;
pub mod pretrain;
pub mod progress;
pub mod recording;
pub mod replay;
pub mod report;
pub mod rollout;
pub mod scenes;
pub mod sights;
pub mod stats;
pub mod tasks;
pub mod threshold;
pub mod verify;
pub mod visual_training;

pub use evaluate::evaluate;
