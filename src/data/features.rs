//! Feature files: one feature map a frame, 16-bit floats, computed once by whoever owns the encoder.

use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::{Deserialize, Serialize};

/// What a feature file holds; its first line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Version of this format.
    pub format_version: u32,
    /// The digest of the encoder that computed it.
    pub encoder: String,
    /// The digest of the trajectories whose frames these are.
    pub dataset: String,
    /// How many maps.
    pub maps: u64,
    /// Numbers in a map.
    pub numbers: u64,
}

impl Header {
    /// The format version this program reads and writes.
    pub const FORMAT: u32 = 1;

    /// The file's name in a dataset's `cache` folder.
    pub fn file_name(&self) -> String {
        format!("features-{}-{}.bin", self.encoder, self.dataset)
    }
}

/// Every map of a dataset, in memory.
pub struct Features {
    bytes: Vec<u8>,
    /// Bytes of a map.
    width: usize,
}

impl Features {
    /// Reads a feature file, if it is there and whole and holds what `wanted` says.
    ///
    /// # Errors
    /// When the file is there but cannot be read.
    pub fn read(folder: &Path, wanted: &Header) -> anyhow::Result<Option<Features>> {
        let path = folder.join(wanted.file_name());
        let Ok(mut file) = File::open(&path) else { return Ok(None) };
        let line = serde_json::to_string(wanted)? + "\n";
        let expected = wanted.maps * wanted.numbers * 2;
        let mut bytes = Vec::with_capacity(line.len() + expected as usize);
        file.read_to_end(&mut bytes).with_context(|| format!("{} cannot be read", path.display()))?;
        if bytes.len() as u64 != line.len() as u64 + expected || !bytes.starts_with(line.as_bytes()) {
            return Ok(None);
        }
        bytes.drain(..line.len());
        Ok(Some(Features { bytes, width: 2 * wanted.numbers as usize }))
    }

    /// Adds the maps of another file of the same encoder after these.
    pub fn append(&mut self, mut other: Features) {
        self.bytes.append(&mut other.bytes);
    }

    /// Appends the bytes of one map: little-endian 16-bit floats.
    pub fn gather(&self, map: usize, into: &mut Vec<u8>) {
        into.extend_from_slice(&self.bytes[map * self.width..(map + 1) * self.width]);
    }

    /// How many maps there are.
    pub fn len(&self) -> usize {
        self.bytes.len() / self.width.max(1)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }
}

/// Writes a feature file; it appears when it is whole.
pub struct Writer {
    header: Header,
    path: PathBuf,
    file: BufWriter<tempfile::NamedTempFile>,
    written: u64,
}

impl Writer {
    /// Begins a file in `folder`, which is made if need be.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub fn create(folder: &Path, header: Header) -> anyhow::Result<Writer> {
        let path = folder.join(header.file_name());
        let begin = || -> anyhow::Result<BufWriter<tempfile::NamedTempFile>> {
            std::fs::create_dir_all(folder)?;
            let mut file = BufWriter::new(tempfile::NamedTempFile::new_in(folder)?);
            file.write_all((serde_json::to_string(&header)? + "\n").as_bytes())?;
            Ok(file)
        };
        let file = begin().with_context(|| format!("{} cannot be written", path.display()))?;
        Ok(Writer { header, path, file, written: 0 })
    }

    /// Adds maps: little-endian 16-bit floats.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn add(&mut self, bytes: &[u8]) -> anyhow::Result<()> {
        self.file.write_all(bytes).with_context(|| format!("{} cannot be written", self.path.display()))?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// Puts the file in place.
    ///
    /// # Errors
    /// When another number of maps was added than the header says, or the disk is full.
    pub fn finish(self) -> anyhow::Result<()> {
        let expected = self.header.maps * self.header.numbers * 2;
        anyhow::ensure!(self.written == expected, "{} bytes of features were computed, not {expected}", self.written);
        self.file.into_inner().map_err(std::io::IntoInnerError::into_error)?.persist(&self.path)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header { format_version: 1, encoder: "e".into(), dataset: "d".into(), maps: 2, numbers: 3 }
    }

    #[test]
    fn maps_come_back_and_a_file_for_other_data_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = Writer::create(folder.path(), header()).unwrap();
        writer.add(&[1, 2, 3, 4, 5, 6]).unwrap();
        writer.add(&[7, 8, 9, 10, 11, 12]).unwrap();
        writer.finish().unwrap();
        let features = Features::read(folder.path(), &header()).unwrap().unwrap();
        let mut bytes = Vec::new();
        features.gather(1, &mut bytes);
        assert_eq!((features.len(), bytes), (2, vec![7, 8, 9, 10, 11, 12]));
        assert!(Features::read(folder.path(), &Header { maps: 3, ..header() }).unwrap().is_none());
    }

    #[test]
    fn a_short_file_is_never_put_in_place() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = Writer::create(folder.path(), header()).unwrap();
        writer.add(&[1, 2]).unwrap();
        assert!(writer.finish().is_err());
        assert!(Features::read(folder.path(), &header()).unwrap().is_none());
    }
}
