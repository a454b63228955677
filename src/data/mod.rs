//! Data: dataset folders, and the importer that makes one of ALFRED's published files.

pub mod alfred;
pub mod dataset;

pub use dataset::Dataset;
