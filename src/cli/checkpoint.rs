//! A checkpoint as the command line names it: a folder, a name among `checkpoints/`, or one on the Hub.

use std::path::{Path, PathBuf};

use super::streams::say;
use crate::agent::policy_source;
use crate::data::hub::{Hub, HubCache, HubName};

/// The folder of a checkpoint, fetched where it is on the Hub.
///
/// # Errors
/// When it has a name of the Hub's, and can neither be found in the cache nor fetched.
pub(super) fn folder(named: &Path) -> anyhow::Result<PathBuf> {
    match HubName::of_path(named) {
        Some(name) => name.folder(&Hub::of_user(), &HubCache::of_user(), &mut |note| say(note)),
        None => Ok(policy_source::folder_of(named)),
    }
}
