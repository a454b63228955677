//! Data: dataset folders, the importer that makes one of ALFRED's published files, and what is derived for training.

pub mod alfred;
pub mod dataset;
pub mod features;
pub mod items;

pub use dataset::Dataset;
