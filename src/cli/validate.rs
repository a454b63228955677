//! Validates a new checkpoint in generated houses and writes its model card.

use std::path::Path;

use super::progress::Progress;
use super::streams::say;
use crate::agent::config::CheckpointConfig;
use crate::agent::learned::SharedEmbedder;
use crate::agent::memory_agent::config::MemoryConfig;
use crate::agent::policy_source::load_agent;
use crate::data::atomic_file;
use crate::nets::device::best_device;
use crate::train::model_card::{card, memory_card};
use crate::train::preset::ValidationSpec;
use crate::train::validation;

/// Validates the checkpoint in `folder`; writes and prints its model card.
///
/// # Errors
/// When it cannot be loaded, or the card not be written.
pub(crate) fn validate(
    folder: &Path,
    spec: &ValidationSpec,
    sentences: Option<SharedEmbedder>,
    mut progress: Progress,
) -> anyhow::Result<()> {
    let mut policy = load_agent(folder, sentences, best_device())?;
    let report = validation::validate(policy.as_mut(), spec, &mut progress)?;
    progress.end();
    let name = name(folder);
    let text = match MemoryConfig::is_there(folder) {
        true => memory_card(&name, &MemoryConfig::read(folder)?, &report),
        false => card(&name, &CheckpointConfig::read(folder)?, &report),
    };
    atomic_file::write(&folder.join("README.md"), text.as_bytes())?;
    say(text.trim_end());
    Ok(())
}

/// A folder's name, as cards and configurations give it.
pub(crate) fn name(folder: &Path) -> String {
    folder.file_name().map_or_else(|| folder.display().to_string(), |name| name.to_string_lossy().into_owned())
}
