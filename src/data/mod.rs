//! Data: task files, dataset folders, and the importer that makes one of ALFRED's published files.

pub mod alfred;
pub mod dataset;
pub mod json;
pub mod taskset;

pub use dataset::Dataset;
