//! Files that are there whole or not at all.

use std::io::{self, Write};
use std::path::Path;

use anyhow::Context;
use tempfile::NamedTempFile;

use super::folder;

/// How the names of files begin that are being written.
pub(crate) const UNFINISHED: &str = ".sprint-";

/// Removes what a killed process did not get to rename from a folder that nobody else writes; failing to does no harm.
pub(crate) fn remove_unfinished(folder: &Path) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    for entry in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(UNFINISHED)) {
        let _ = std::fs::remove_file(entry.path());
    }
}

/// What will be the file at `path`, beside it; dropped, it is gone. Makes the folder when there is none.
///
/// # Errors
/// When the folder cannot be made or written to.
pub(crate) fn begin(path: &Path) -> io::Result<NamedTempFile> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder::make(folder)?;
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // A temporary file is private; what it becomes is as readable as the user's umask allows.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.prefix(UNFINISHED).tempfile_in(folder)
}

/// Gives it its name, over an older file of that name.
///
/// # Errors
/// When it cannot be written out or renamed; the old file, if any, is untouched then.
pub(crate) fn keep(file: NamedTempFile, path: &Path) -> io::Result<()> {
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

/// Writes a file atomically.
///
/// # Errors
/// As [`begin`] and [`keep`], with the path.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let whole = || -> io::Result<()> {
        let mut file = begin(path)?;
        file.write_all(bytes)?;
        keep(file, path)
    };
    whole().with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_is_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/file.json");
        write(&path, b"one").unwrap();
        write(&path, b"two").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"two");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_it_as_they_may_read_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        let (whole, plain) = (folder.path().join("whole"), folder.path().join("plain"));
        write(&whole, b"").unwrap();
        std::fs::write(&plain, b"").unwrap();
        assert_eq!(mode(&whole), mode(&plain));
    }
}
