//! What a revision holds of a checkpoint.

/// The files of a checkpoint.
pub(super) const FILES: [&str; 2] = ["config.json", "model.safetensors"];

/// What a revision holds of a checkpoint.
#[derive(Debug)]
pub(super) struct Revision {
    pub(super) commit: String,
    pub(super) files: Vec<HubFile>,
}

/// A file of a revision.
#[derive(Debug)]
pub(super) struct HubFile {
    pub(super) name: &'static str,
    pub(super) size: u64,
    /// What its content is called.
    pub(super) content: String,
}
