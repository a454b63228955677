//! Files of JSON lines that are only ever added to: a line is there whole, or, after a kill, not at all.

use std::fs::TryLockError;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::locked_file::LockedFile;
use super::{folder, plain_file, text_file};

/// The file's first line.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format_version: u32,
}

/// The lines of such a file and the length in bytes of its whole lines. A torn last line is left out; where there is no file
/// there are no lines.
///
/// # Errors
/// When it cannot be read, is of another version, or a line is malformed; names the line.
pub(crate) fn read<T: DeserializeOwned>(path: &Path, format: u32) -> anyhow::Result<(Vec<T>, usize)> {
    let bytes = match plain_file::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok((Vec::new(), 0)),
        Err(error) => return Err(error).with_context(|| format!("{} cannot be read", path.display())),
    };
    let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1);
    let mut lines = bytes[..whole].split_inclusive(|&byte| byte == b'\n');
    if let Some(first) = lines.next() {
        let header: Header = serde_json::from_slice(text_file::content(first)?)
            .with_context(|| format!("{}, line 1", path.display()))?;
        ensure!(
            header.format_version == format,
            "{}: format_version: {}, but this program reads {format}",
            path.display(),
            header.format_version
        );
    }
    let parse = |(number, line): (usize, &[u8])| {
        serde_json::from_slice(line).with_context(|| format!("{}, line {}", path.display(), number + 2))
    };
    Ok((lines.enumerate().map(parse).collect::<anyhow::Result<_>>()?, whole))
}

/// Such a file, opened to be added to. One process at a time.
pub struct LineLog {
    path: PathBuf,
    file: LockedFile,
    /// The length of its whole lines.
    whole: u64,
}

impl LineLog {
    /// Opens or begins the file, mends a torn last line, and returns what it holds.
    ///
    /// # Errors
    /// When it is malformed, in use, or cannot be written to.
    pub(crate) fn open<T: DeserializeOwned>(path: &Path, format: u32) -> anyhow::Result<(LineLog, Vec<T>)> {
        let context = || format!("{} cannot be written", path.display());
        if let Some(folder) = path.parent() {
            folder::make(folder).with_context(context)?;
        }
        let file = plain_file::append(path).with_context(context)?;
        let file = match LockedFile::lock(file) {
            Err(TryLockError::WouldBlock) => bail!("{}: another process is writing to it", path.display()),
            Err(TryLockError::Error(error)) => return Err(error).with_context(context),
            Ok(file) => file,
        };
        let (lines, whole) = read(path, format)?;
        file.set_len(whole as u64).with_context(context)?;
        let mut log = LineLog { path: path.to_owned(), file, whole: whole as u64 };
        if whole == 0 {
            log.append(&[Header { format_version: format }])?;
        }
        Ok((log, lines))
    }

    /// Adds lines in one write, and waits until the disk has them.
    ///
    /// # Errors
    /// When the disk is full; nothing of them stays then.
    pub(crate) fn append<T: Serialize>(&mut self, lines: &[T]) -> anyhow::Result<()> {
        let mut bytes = Vec::new();
        for line in lines {
            serde_json::to_writer(&mut bytes, line)?;
            bytes.push(b'\n');
        }
        let written = self.file.write_all(&bytes).and_then(|()| self.file.sync_data());
        if written.is_err() {
            // A part of a line would spoil the next one.
            let _ = self.file.set_len(self.whole);
        }
        written.with_context(|| format!("{} cannot be written", self.path.display()))?;
        self.whole += bytes.len() as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_added_and_a_torn_one_is_mended() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in/a/folder.jsonl");
        LineLog::open::<u32>(&path, 1).unwrap().0.append(&[1, 2]).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.extend(b"34");
        std::fs::write(&path, bytes).unwrap();
        let (mut log, lines) = LineLog::open::<u32>(&path, 1).unwrap();
        assert_eq!(lines, [1, 2]);
        assert!(LineLog::open::<u32>(&path, 1).err().unwrap().to_string().contains("another process"));
        log.append(&[5]).unwrap();
        assert_eq!(read::<u32>(&path, 1).unwrap().0, [1, 2, 5]);
        assert!(read::<u32>(&path, 2).unwrap_err().to_string().contains("reads 2"));
        assert!(format!("{:#}", read::<String>(&path, 1).unwrap_err()).contains("line 2"));
        assert!(read::<u32>(&folder.path().join("none"), 1).unwrap().0.is_empty());
    }
}
