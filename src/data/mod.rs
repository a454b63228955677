//! Data: task files, dataset folders, the importer that makes one of ALFRED's published files, and what is derived for training.

pub mod ensure_free;
pub mod atomic_file;
pub mod json_positions;
pub mod alfred;
pub mod dataset;
pub mod features;
pub mod items;
pub mod json;
pub mod schema;
pub mod selection;
pub mod summaries;
pub mod taskset;

pub use dataset::Dataset;
