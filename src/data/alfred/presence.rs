//! Whether a file of a checkout is there: what stands in its place is not taken for its absence.

use std::path::Path;

/// Whether there is a file of that name, or a link to one.
///
/// # Errors
/// Says what is there instead: reading a pipe would wait for ever.
pub(crate) fn is_file(path: &Path) -> Result<bool, String> {
    let Ok(there) = std::fs::symlink_metadata(path) else { return Ok(false) };
    match std::fs::metadata(path) {
        Ok(meant) if meant.is_file() => Ok(true),
        Ok(meant) if meant.is_dir() => Err("a folder stands where a file should be".to_owned()),
        Ok(_) => Err("a pipe, socket or device stands where a file should be".to_owned()),
        Err(error) if there.is_symlink() => Err(format!("a link that leads to no file ({error})")),
        Err(error) => Err(error.to_string()),
    }
}
