//! Data: task files, dataset folders, the importer that makes one of ALFRED's published files, and what is derived for training.

pub mod annotations;
pub(crate) mod ensure_free;
pub(crate) mod atomic_file;
pub(crate) mod json_positions;
pub mod alfred;
pub mod dataset;
pub mod features;
pub(crate) mod folder;
pub(crate) mod folder_lock;
pub(crate) mod hub;
pub mod items;
pub mod json;
pub(crate) mod line_log;
pub(crate) mod locked_file;
pub(crate) mod plain_file;
pub(crate) mod ranked_chains;
pub mod schema;
pub mod selection;
pub mod summaries;
pub mod taskset;
pub(crate) mod text_file;

pub use dataset::Dataset;
