//! Folders are made here: what stands in their way is named.

use std::io::{Error, ErrorKind, Result};
use std::path::Path;

/// Makes a folder with those above it, where there is none.
///
/// # Errors
/// When it cannot be made; says what stands in its place or in the place of one above it.
pub(crate) fn make(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|error| match in_the_way(path) {
        Some(told) if error.kind() != ErrorKind::PermissionDenied => Error::new(error.kind(), told),
        _ => error,
    })
}

fn in_the_way(path: &Path) -> Option<String> {
    let above = path.ancestors().find(|above| std::fs::symlink_metadata(above).is_ok_and(|there| !there.is_dir()))?;
    match std::fs::metadata(above) {
        Ok(meant) if meant.is_dir() => None,
        Ok(_) => Some(format!("{} is a file; name a folder", above.display())),
        Err(_) => Some(format!("{} is a link that leads nowhere; name a folder", above.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_in_the_place_of_a_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("file"), "").unwrap();
        std::os::unix::fs::symlink("gone", path("link")).unwrap();
        for (name, told) in [("file", "file is a file"), ("file/in", "file is a file"), ("link", "leads nowhere")] {
            let error = make(&path(name)).unwrap_err().to_string();
            assert!(error.contains(told), "{name}: {error}");
        }
        make(&path("new/in")).unwrap();
        std::os::unix::fs::symlink("new", path("to a folder")).unwrap();
        make(&path("to a folder")).unwrap();
    }
}
