//! Files are opened for reading here: what is no file is named, instead of being waited for.

use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind, Read, Result};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

/// What is no file of a known length is read up to this many bytes: a device may never end.
const LARGEST: u64 = 1 << 30;

/// Opens a file to read it. A pipe that the caller holds the other end of (`/dev/stdin`, `<(...)`) is one, too.
///
/// # Errors
/// When it cannot be opened, or is a folder, a socket, or a pipe in a folder, which nobody may ever write to.
pub(crate) fn open(path: &Path) -> Result<File> {
    check(path)?;
    File::open(path)
}

/// Opens a file to read it and add to it, and begins it where there is none.
///
/// # Errors
/// As [`open`], or when it cannot be written to.
pub(crate) fn append(path: &Path) -> Result<File> {
    if path.exists() {
        check(path)?;
    }
    OpenOptions::new().read(true).create(true).append(true).open(path)
}

/// Opens a file to read and change it, and begins it where there is none.
///
/// # Errors
/// As [`append`].
pub(crate) fn change(path: &Path) -> Result<File> {
    if path.exists() {
        check(path)?;
    }
    OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)
}

/// Whether a path can be opened without waiting for somebody.
///
/// # Errors
/// As [`open`].
fn check(path: &Path) -> Result<()> {
    let kind = std::fs::metadata(path)?.file_type();
    let handed_over = ["/dev", "/proc"].iter().any(|folder| path.starts_with(folder));
    let told = match kind {
        kind if kind.is_dir() => "it is a folder; a file is wanted",
        kind if kind.is_fifo() && !handed_over => "it is a pipe; write what comes out of it to a file, and name that",
        kind if kind.is_socket() => "it is a socket; a file is wanted",
        _ => return Ok(()),
    };
    Err(Error::new(ErrorKind::InvalidInput, told))
}

/// The bytes of a file.
///
/// # Errors
/// As [`open`], and when it is a device that does not end.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>> {
    let mut file = open(path)?;
    let mut bytes = Vec::new();
    if file.metadata()?.is_file() {
        file.read_to_end(&mut bytes)?;
    } else if file.take(LARGEST + 1).read_to_end(&mut bytes)? as u64 > LARGEST {
        return Err(Error::new(ErrorKind::InvalidInput, format!("it does not end within {} MiB", LARGEST >> 20)));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_pipe_a_socket_and_a_folder_are_named_and_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("file"), "a").unwrap();
        std::os::unix::fs::symlink("file", path("link")).unwrap();
        assert_eq!((read(&path("file")).unwrap(), read(&path("link")).unwrap()), (b"a".to_vec(), b"a".to_vec()));
        assert!(Command::new("mkfifo").arg(path("pipe")).status().unwrap().success());
        std::os::unix::fs::symlink("pipe", path("to a pipe")).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(path("socket")).unwrap();
        for (name, told) in [("pipe", "a pipe"), ("to a pipe", "a pipe"), ("socket", "a socket"), (".", "a folder")] {
            let error = read(&path(name)).unwrap_err().to_string();
            assert!(error.contains(told), "{name}: {error}");
            assert_eq!(append(&path(name)).unwrap_err().to_string(), error);
        }
        append(&path("new")).unwrap();
        assert_eq!(read(&path("none")).unwrap_err().kind(), ErrorKind::NotFound);
        assert!(read(Path::new("/dev/null")).unwrap().is_empty());
    }
}
