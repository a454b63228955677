//! The folder of the control sockets, which only its user may enter.

use std::fs::{DirBuilder, Metadata};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

/// The folder of the user's own sockets: in `$XDG_RUNTIME_DIR`, else in the system's folder for temporary files.
pub(super) fn path() -> PathBuf {
    let given = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|path| path.is_absolute());
    match given {
        Some(base) => base.join("sprint"),
        None => std::env::temp_dir().join(format!("sprint-{}", own_user())),
    }
}

/// The user that the program runs as.
pub(super) fn own_user() -> u32 {
    rustix::process::geteuid().as_raw()
}

/// Makes the folder where it is missing.
///
/// # Errors
/// When it cannot be made, or is there and another user may write in it.
pub(super) fn make(folder: &Path) -> anyhow::Result<()> {
    match DirBuilder::new().mode(0o700).create(folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => {
            Err(error).with_context(|| format!("cannot make {}", folder.display()))
        }
        _ => check(folder),
    }
}

/// Checks that the folder is the user's alone.
///
/// # Errors
/// When it is missing, or another's; says so.
pub(super) fn check(folder: &Path) -> anyhow::Result<()> {
    // A link is not followed: it could lead anywhere.
    let found = folder.symlink_metadata().with_context(|| format!("cannot read {}", folder.display()))?;
    if !is_private(&found, own_user()) {
        bail!(
            "{}: it must be a folder of your own that nobody else may enter (chmod 700); remove it, or set XDG_RUNTIME_DIR",
            folder.display()
        );
    }
    Ok(())
}

fn is_private(found: &Metadata, user: u32) -> bool {
    found.is_dir() && found.uid() == user && found.mode() & 0o077 == 0
}

/// The sockets in a folder, by name.
///
/// # Errors
/// When the folder is there and cannot be listed.
pub(super) fn sockets(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = match folder.read_dir() {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut found: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "sock"))
        .collect();
    found.sort();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_folder_is_made_private_and_one_that_others_may_enter_or_that_is_a_link_is_refused() {
        let base = tempfile::tempdir().unwrap();
        let folder = base.path().join("sprint");
        make(&folder).unwrap();
        make(&folder).unwrap();
        assert_eq!(folder.metadata().unwrap().mode() & 0o777, 0o700);
        let link = base.path().join("link");
        std::os::unix::fs::symlink(&folder, &link).unwrap();
        assert!(check(&link).unwrap_err().to_string().contains("a folder of your own"));
        std::fs::set_permissions(&folder, PermissionsExt::from_mode(0o750)).unwrap();
        assert!(make(&folder).unwrap_err().to_string().contains("chmod 700"));
        assert!(!is_private(&base.path().metadata().unwrap(), own_user() + 1));
    }
}
