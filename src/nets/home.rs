//! Where fetched things lie: libtorch, sentence encoders, cached embeddings.

use std::path::PathBuf;

use etcetera::BaseStrategy;

/// The folder that set-up fetches into: `SPRINT_HOME`, else `sprint` in the user's XDG cache folder.
pub(crate) fn cache_folder() -> PathBuf {
    if let Some(folder) = std::env::var_os("SPRINT_HOME").filter(|folder| !folder.is_empty()) {
        return PathBuf::from(folder);
    }
    match etcetera::choose_base_strategy() {
        Ok(base) => base.cache_dir().join("sprint"),
        Err(_) => std::env::temp_dir().join("sprint"),
    }
}
