//! Data: dataset folders and what is derived from them.

pub mod dataset;
pub mod features;
pub mod items;
