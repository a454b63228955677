//! One process at a time writes a folder: the later of two would undo what the earlier one did.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use super::folder;

/// A folder that no other process may write, for as long as this lives. Nothing is left in it; a killed process leaves no lock.
#[must_use]
pub(crate) struct FolderLock {
    folder: PathBuf,
    _held: File,
}

impl FolderLock {
    /// Makes the folder where there is none, and takes it.
    ///
    /// # Errors
    /// When another process has it, or it cannot be made.
    pub(crate) fn take(folder: &Path) -> anyhow::Result<FolderLock> {
        let name = folder.display();
        folder::make(folder).with_context(|| format!("cannot make {name}"))?;
        let held = File::open(folder).with_context(|| format!("cannot read {name}"))?;
        match held.try_lock() {
            Err(TryLockError::WouldBlock) => {
                bail!("{name}: another process is writing this folder; wait for it to end, or name another folder")
            }
            // A file system without locks: the user has to see to it.
            Err(TryLockError::Error(_)) | Ok(()) => {}
        }
        Ok(FolderLock { folder: folder.to_owned(), _held: held })
    }

    /// The folder.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_writer_of_a_folder_is_refused_until_the_first_ends() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let first = FolderLock::take(&out).unwrap();
        let told = FolderLock::take(&out).err().unwrap().to_string();
        assert!(told.contains("another process") && told.contains("out"), "{told}");
        drop(first);
        assert!(FolderLock::take(&out).is_ok());
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 0, "nothing is left in it");
    }
}
