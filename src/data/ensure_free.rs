//! Whether a folder is free for something new: nobody's work is written over unasked.

use std::path::Path;

/// What a file in a folder says that the folder holds.
const HELD: [(&str, &str); 3] =
    [("config.json", "a checkpoint"), ("dataset.json", "a dataset"), ("manifest.json", "a run")];

/// Whether a folder holds no checkpoint, dataset or run, or is not there yet.
///
/// # Errors
/// Says what it holds.
pub(crate) fn check(folder: &Path) -> anyhow::Result<()> {
    match HELD.iter().find(|(file, _)| folder.join(file).exists()) {
        Some((_, held)) => anyhow::bail!("{} holds {held} already: name another folder", folder.display()),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_folder_holds_is_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(check(folder.path()).is_ok() && check(&folder.path().join("none")).is_ok());
        std::fs::write(folder.path().join("notes.txt"), "").unwrap();
        assert!(check(folder.path()).is_ok());
        std::fs::write(folder.path().join("dataset.json"), "{}").unwrap();
        let error = check(folder.path()).unwrap_err().to_string();
        assert!(error.contains("holds a dataset already"), "{error}");
    }
}
