//! Versioned JSON files: read strictly, written whole or not at all.

use std::io::Read;
use std::path::Path;

use anyhow::{Context, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use super::{atomic_file, plain_file, text_file};

/// No file of ours comes near this many bytes; a larger one (or an endless device) is refused before it fills the memory.
const LARGEST: u64 = 1 << 30;

/// A file as it was read, with the fingerprint of its bytes.
pub struct Document<T> {
    /// The parsed document.
    pub value: T,
    /// SHA-256 of the bytes, in hexadecimal.
    pub(crate) digest: String,
}

/// Reads a JSON file that carries `format_version`.
///
/// # Errors
/// Each names the file: when it cannot be read, is no JSON, has another version, or departs from the format (then with the field).
pub(crate) fn read<T: DeserializeOwned>(path: &Path, version: u32) -> anyhow::Result<Document<T>> {
    let bytes = read_bytes(path)?;
    let value = parse(&bytes, version).with_context(|| format!("{}", path.display()))?;
    Ok(Document { value, digest: hex(&Sha256::digest(&bytes)) })
}

/// Reads a file of a size that a file of ours may have.
///
/// # Errors
/// When it cannot be read, or is larger.
pub(crate) fn read_bytes(path: &Path) -> anyhow::Result<Vec<u8>> {
    let name = path.display();
    let file = plain_file::open(path).with_context(|| format!("cannot read {name}"))?;
    let too_large = || anyhow::anyhow!("{name}: larger than {} MiB, which no such file is", LARGEST >> 20);
    let length = file.metadata().with_context(|| format!("cannot read {name}"))?.len();
    anyhow::ensure!(length <= LARGEST, too_large());
    let mut bytes = Vec::new();
    // A device or a pipe says nothing of its length.
    file.take(LARGEST + 1).read_to_end(&mut bytes).with_context(|| format!("cannot read {name}"))?;
    anyhow::ensure!(bytes.len() as u64 <= LARGEST, too_large());
    Ok(bytes)
}

/// Parses JSON that carries `format_version`: the version first, so that a later format is not reported as a misspelt field.
///
/// # Errors
/// When it is no JSON, has another version, or departs from the format; the message begins with the field.
pub(crate) fn parse<T: DeserializeOwned>(bytes: &[u8], version: u32) -> anyhow::Result<T> {
    #[derive(serde::Deserialize)]
    struct Versioned {
        format_version: Option<serde_json::Value>,
    }
    let bytes = text_file::content(bytes)?;
    // Serde would take a list for a struct.
    if bytes.trim_ascii_start().first() == Some(&b'[') {
        bail!("not such a file: its outermost value is a list");
    }
    let versioned: Versioned = serde_json::from_slice(bytes).map_err(|error| match error.classify() {
        serde_json::error::Category::Eof => anyhow::anyhow!("the file is cut off: {error}"),
        serde_json::error::Category::Data => anyhow::anyhow!("not such a file: {error}"),
        _ => anyhow::anyhow!("not JSON: {error}"),
    })?;
    match versioned.format_version {
        None => bail!("format_version: missing; this is not a file of this program"),
        Some(found) if found != version => {
            bail!("format_version: {found}, but this program reads {version}; use the version of sprint that wrote it")
        }
        Some(_) => {}
    }
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    serde_path_to_error::deserialize(&mut deserializer).map_err(|error| match error.path().to_string().as_str() {
        "." => anyhow::anyhow!("{}", error.inner()),
        field => anyhow::anyhow!("{field}: {}", error.inner()),
    })
}

/// Writes a JSON file atomically, in one line.
///
/// # Errors
/// When the folder cannot be written to; the old file, if any, is untouched then.
pub fn write<T: Serialize>(path: &Path, value: &T) -> anyhow::Result<()> {
    write_line(path, serde_json::to_vec(value))
}

/// Writes a JSON file atomically, indented for people.
///
/// # Errors
/// As [`write()`].
pub(crate) fn write_pretty<T: Serialize>(path: &Path, value: &T) -> anyhow::Result<()> {
    write_line(path, serde_json::to_vec_pretty(value))
}

fn write_line(path: &Path, text: serde_json::Result<Vec<u8>>) -> anyhow::Result<()> {
    let mut text = text.with_context(|| format!("cannot write {}", path.display()))?;
    text.push(b'\n');
    atomic_file::write(path, &text)
}

/// Bytes in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct MeasuredTable {
        format_version: u32,
        rows: Vec<TableRow>,
    }

    #[derive(Debug, PartialEq, Serialize, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct TableRow {
        at: u8,
    }

    fn complaint(text: &str) -> String {
        format!("{:#}", parse::<MeasuredTable>(text.as_bytes(), 1).unwrap_err())
    }

    #[test]
    fn what_is_written_reads_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deeper/sample.json");
        let sample = MeasuredTable { format_version: 1, rows: vec![TableRow { at: 7 }] };
        write(&path, &sample).unwrap();
        let back = read::<MeasuredTable>(&path, 1).unwrap();
        assert_eq!(back.value, sample);
        assert_eq!(back.digest.len(), 64);
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "no temporary file stays");
    }

    #[test]
    fn a_complaint_names_the_field() {
        assert!(complaint(r#"{"format_version":1,"rows":[{"at":1},{"at":256}]}"#).starts_with("rows[1].at: "));
        assert!(complaint(r#"{"format_version":1,"rows":[{"at":1,"to":2}]}"#).contains("`to`"));
        assert!(complaint(r#"{"format_version":1}"#).contains("`rows`"));
    }

    #[test]
    fn another_version_is_named_before_any_other_difference() {
        assert!(complaint(r#"{"format_version":2,"pages":[]}"#).starts_with("format_version: 2, but"));
        assert!(complaint(r#"{"format_version":"1","rows":[]}"#).starts_with("format_version: \"1\", but"));
        assert!(complaint(r#"{"rows":[]}"#).starts_with("format_version: missing"));
    }

    #[test]
    fn a_file_saved_with_a_byte_order_mark_is_read_and_one_saved_as_utf_16_is_named() {
        let text = "\u{feff}{\"format_version\":1,\"rows\":[{\"at\":7}]}";
        assert_eq!(parse::<MeasuredTable>(text.as_bytes(), 1).unwrap().rows, [TableRow { at: 7 }]);
        let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert!(parse::<MeasuredTable>(&wide, 1).unwrap_err().to_string().contains("UTF-16"));
    }

    #[test]
    fn a_torn_file_and_a_file_of_something_else_are_told_apart() {
        assert!(complaint(r#"{"format_version":1,"rows":[{"at""#).contains("cut off"));
        assert!(complaint("").contains("cut off"));
        assert!(complaint("PK\u{3}").contains("not JSON"));
        assert!(complaint("7").contains("not such a file"));
        assert!(complaint("[1,[]]").contains("not such a file"));
        assert!(complaint(&"{\"a\":".repeat(100_000)).contains("cut off"));
    }
}
