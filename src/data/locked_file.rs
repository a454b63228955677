//! Files that one process at a time writes.

use std::fs::{File, TryLockError};
use std::ops::{Deref, DerefMut};

/// An open file that no other process may lock, for as long as this lives. A killed process leaves no lock.
pub(crate) struct LockedFile(File);

impl LockedFile {
    /// Locks the file.
    ///
    /// # Errors
    /// When another process has locked it, or the file system knows no locks.
    pub(crate) fn lock(file: File) -> Result<LockedFile, TryLockError> {
        file.try_lock()?;
        Ok(LockedFile(file))
    }

    /// Locks the file where its file system knows locks; elsewhere the user has to see to it. `None` when another process has
    /// locked it.
    pub(crate) fn lock_where_possible(file: File) -> Option<LockedFile> {
        (!matches!(file.try_lock(), Err(TryLockError::WouldBlock))).then_some(LockedFile(file))
    }
}

/// Closing alone is not enough: a child process that another thread starts shares the lock until it runs its own program.
impl Drop for LockedFile {
    fn drop(&mut self) {
        let _ = self.0.unlock();
    }
}

impl Deref for LockedFile {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl DerefMut for LockedFile {
    fn deref_mut(&mut self) -> &mut File {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_free_once_its_writer_ends_though_a_child_still_holds_a_copy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let locked = LockedFile::lock(File::create(&path).unwrap()).unwrap();
        let copy = locked.try_clone().unwrap();
        let other = || LockedFile::lock(File::open(&path).unwrap());
        assert!(matches!(other(), Err(TryLockError::WouldBlock)));
        drop(locked);
        assert!(other().is_ok());
        drop(copy);
    }
}
