//! Runs: episodes, evaluations, trainings, and the folders they write.

pub mod appraise;
pub mod card;
pub mod cloning;
pub mod collect;
pub mod encoding;
pub mod episode;
pub mod evaluate;
pub mod folder;
pub mod footage;
pub mod page;
pub mod presets;
pub mod pretrain;
pub mod progress;
pub mod relabel;
pub mod replay;
pub mod report;
pub mod rollout;
pub mod scenes;
pub mod sights;
pub mod stats;
pub mod tasks;
pub mod threshold;
pub mod visual_training;

pub use evaluate::evaluate;
