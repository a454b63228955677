//! Files: task sets, datasets, and how they are read and written.

pub mod json;
pub mod taskset;
