//! Runs: episodes, evaluations, trainings, and the folders they write.

pub mod appraise;
pub mod batches;
pub mod card;
pub mod collect;
pub mod encoding;
pub mod episode;
pub mod evaluate;
pub mod events;
pub mod folder;
pub mod footage;
pub mod material;
pub mod page;
pub mod plot;
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
pub mod trainer;
pub mod visual_training;

pub use evaluate::evaluate;
