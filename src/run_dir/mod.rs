//! Run folders: the manifest, the episodes of a run in order, reader and writer, shards.

pub mod default_path;
pub mod episode_spec;
pub mod episodes;
pub mod layout;
pub mod manifest;
pub mod reader;
pub mod shard;
pub mod writer;
