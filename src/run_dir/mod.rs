//! Run folders: the manifest, the episodes of a run in order, reader and writer, shards.

pub(crate) mod record_check;
pub(crate) mod default_path;
pub(crate) mod episode_spec;
pub(crate) mod episodes;
pub(crate) mod layout;
pub(crate) mod manifest;
pub(crate) mod policy_places;
pub mod reader;
pub(crate) mod shard;
pub mod writer;
