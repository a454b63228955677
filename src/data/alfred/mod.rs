//! The ALFRED importer: a checkout as published becomes a dataset folder.

pub mod bodies;
pub mod cover;
pub mod facing;
pub mod files;
pub mod fit;
pub mod fixtures;
pub mod furniture;
pub mod import;
pub mod layout;
pub mod merge;
pub mod meshes;
pub mod names;
pub mod parents;
pub mod recording;
pub mod scenes;
pub mod support;
pub mod tasks;
pub mod trajectories;
pub mod walls;

pub use import::{ImportOptions, ImportProgress, ImportSummary, SetBuilt, import};
