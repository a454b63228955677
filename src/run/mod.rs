//! Runs: episodes, evaluations, trainings, and the folders they write.

pub mod appraise;
pub mod breakdown;
pub mod card;
pub mod chance;
pub mod cloning;
pub mod collect;
pub mod episode;
pub mod evaluate;
pub mod failure;
pub mod folder;
pub mod footage;
pub mod page;
pub mod player;
pub mod presets;
pub mod pretrain;
pub mod progress;
pub mod replay;
pub mod report;
pub mod rollout;
pub mod scenes;
pub mod shard;
pub mod sights;
pub mod stats;
pub mod tasks;
pub mod threshold;
pub mod visual_training;
pub mod wording;

pub use evaluate::evaluate;
