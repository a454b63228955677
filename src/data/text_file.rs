//! Text as people's programs save it: the mark that some put before it says nothing, and is passed over.

use std::io::{Error, ErrorKind, Result};
use std::path::Path;

use super::plain_file;

/// The byte-order mark of UTF-8.
const MARK: &[u8] = b"\xEF\xBB\xBF";

/// What a text file says: its bytes without a byte-order mark.
///
/// # Errors
/// When its mark says that it is no UTF-8.
pub(crate) fn content(bytes: &[u8]) -> Result<&[u8]> {
    if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
        return Err(Error::new(ErrorKind::InvalidData, "saved as UTF-16 (or UTF-32): save it as UTF-8"));
    }
    Ok(bytes.strip_prefix(MARK).unwrap_or(bytes))
}

/// A line of text without the mark that the first line of a text may begin with.
pub(crate) fn line(text: &str) -> &str {
    text.strip_prefix('\u{FEFF}').unwrap_or(text)
}

/// Reads a text file.
///
/// # Errors
/// When it cannot be read, or is no UTF-8.
pub(crate) fn read(path: &Path) -> Result<String> {
    let bytes = plain_file::read(path)?;
    let text = content(&bytes)?;
    let text = std::str::from_utf8(text)
        .map_err(|error| Error::new(ErrorKind::InvalidData, format!("not UTF-8 text ({error}): save it as UTF-8")))?;
    Ok(text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_order_mark_is_passed_over_and_another_encoding_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("own.toml");
        for (bytes, text) in [(&b"\xEF\xBB\xBFa = 1\n"[..], "a = 1\n"), (b"a = 1\n", "a = 1\n"), (b"", "")] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(read(&path).unwrap(), text);
        }
        for (bytes, told) in [(&b"\xFF\xFEa\0"[..], "UTF-16"), (b"\xFE\xFF\0a", "UTF-16"), (b"th\xE9", "UTF-8")] {
            std::fs::write(&path, bytes).unwrap();
            assert!(read(&path).unwrap_err().to_string().contains(told));
        }
        assert_eq!((line("\u{FEFF}put"), line("put")), ("put", "put"));
    }
}
