//! One process at a time writes a folder: the later of two would undo what the earlier one did.

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::Context;

use super::folder;
use super::locked_file::LockedFile;

/// A folder that no other process may write, for as long as this lives. Nothing is left in it; a killed process leaves no lock.
#[must_use]
pub(crate) struct FolderLock {
    folder: PathBuf,
    _held: LockedFile,
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
        let held = LockedFile::lock_where_possible(held).with_context(|| {
            format!("{name}: another process is writing this folder; wait for it to end, or name another folder")
        })?;
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
