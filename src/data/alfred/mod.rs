//! The ALFRED importer: a checkout as published becomes a dataset folder.

pub(crate) mod bodies;
pub mod checkout;
pub(crate) mod carving;
pub(crate) mod clearing;
pub(crate) mod cover;
pub(crate) mod facing;
pub(crate) mod files;
pub(crate) mod fit;
pub(crate) mod fixtures;
pub(crate) mod furniture;
pub mod import;
pub mod layout;
pub(crate) mod merge;
pub(crate) mod meshes;
pub(crate) mod names;
pub(crate) mod parents;
pub(crate) mod presence;
pub(crate) mod recording;
pub mod scenes;
pub(crate) mod sightlines;
pub(crate) mod span_task;
pub(crate) mod support;
pub mod tasks;
pub(crate) mod trajectories;
pub(crate) mod walls;

pub use import::{ImportOptions, ImportProgress, ImportSummary, SetBuilt, import};
