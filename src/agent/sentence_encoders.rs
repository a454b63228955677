//! The sentence encoder that an agent was trained with: where it lies, and opened for all who act with it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use anyhow::Context;
use tch::Device;

use super::config::{CheckpointConfig, SentenceSpec};
use super::frame_history::SharedEmbedder;
use super::memory_agent::config::MemoryConfig;
use crate::nets::embedding_cache::Embedder;
use crate::nets::home::cache_folder;

/// Where encoders lie by their names.
fn encoders() -> PathBuf {
    cache_folder().join("encoders")
}

/// The folder of an encoder that was named: a path, or where there is nothing, the name of one in `encoders`.
pub(crate) fn folder_of(named: &Path) -> PathBuf {
    let is_name = named.file_name() == Some(named.as_os_str()) && !named.exists();
    if is_name { encoders().join(named) } else { named.to_owned() }
}

/// What a checkpoint says of the encoder in `folder`; the folder itself only where the name does not lead to it.
pub(crate) fn spec_of(folder: &Path, digest: &str) -> SentenceSpec {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let name = folder.file_name().map_or_else(|| whole.display().to_string(), |name| name.to_string_lossy().into());
    let is_led_to = encoders().join(&name).canonicalize().is_ok_and(|found| found == whole);
    SentenceSpec { name, digest: digest.to_owned(), folder: (!is_led_to).then_some(whole) }
}

/// Opens the encoder that the checkpoint names; nothing for an agent that reads no sentence embeddings.
///
/// # Errors
/// When the checkpoint is malformed, or the encoder is not at hand or another one.
pub(crate) fn open_for(checkpoint: &Path, device: Device) -> anyhow::Result<Option<SharedEmbedder>> {
    if MemoryConfig::is_there(checkpoint) {
        return Ok(None);
    }
    let config = CheckpointConfig::read(checkpoint)?;
    let Some(spec) = config.read_sentences() else { return Ok(None) };
    let file = checkpoint.join("config.json");
    let folder = find(spec).with_context(|| file.display().to_string())?;
    let embedder = Embedder::open(&folder, device)?;
    config.goes_with(embedder.encoder()).with_context(|| format!("{}: in {}", file.display(), folder.display()))?;
    Ok(Some(Arc::new(Mutex::new(embedder))))
}

/// The encoder's folder: by its name, else where it lay when the agent was trained.
fn find(spec: &SentenceSpec) -> anyhow::Result<PathBuf> {
    let by_name = encoders().join(&spec.name);
    let found = [Some(&by_name), spec.folder.as_ref()].into_iter().flatten().find(|folder| folder.is_dir());
    found.cloned().with_context(|| {
        let elsewhere = spec.folder.iter().map(|folder| format!(" nor in {}", folder.display())).collect::<String>();
        let remedy = if spec.name == DEFAULT { "; `make setup` fetches it" } else { "" };
        format!(
            "the agent's sentence encoder {} is not in {}{elsewhere}: put that folder or a link to it there{remedy}",
            spec.name,
            by_name.display()
        )
    })
}

/// The name of the encoder that set-up fetches.
const DEFAULT: &str = "all-MiniLM-L6-v2";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_encoder_that_is_nowhere_is_told_with_its_places() {
        let spec = SentenceSpec { name: "wide".into(), digest: "00".into(), folder: Some("/nowhere/wide".into()) };
        let told = find(&spec).unwrap_err().to_string();
        assert!(told.contains("sentence encoder wide is not in") && told.contains("nor in /nowhere/wide"), "{told}");
        assert!(!told.contains("make setup"), "{told}");
    }

    #[test]
    fn the_folder_is_noted_only_where_the_name_does_not_lead_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let noted = spec_of(folder.path(), "d");
        assert_eq!(noted.folder.as_deref(), Some(folder.path().canonicalize().unwrap().as_path()));
        assert_eq!(find(&noted).unwrap(), folder.path().canonicalize().unwrap());
        assert_eq!(folder_of(folder.path()), folder.path());
        assert!(folder_of(Path::new("all-MiniLM-L6-v2")).ends_with("encoders/all-MiniLM-L6-v2"));
    }
}
