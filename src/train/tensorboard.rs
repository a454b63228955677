//! TensorBoard event files: every scalar of a training, for whoever watches it there. Written by hand: of the crates that write
//! them, `tensorboard-rs` brings an old `image` and `protobuf` 2, and `tboard` needs `protoc` to build.
//!
//! A file is a run of records: the length of the data as a little-endian u64, a masked CRC-32C of these 8 bytes, the data, and a
//! masked CRC-32C of the data. The data is a protocol buffer, `Event`: wall time (field 1, double), step (2, varint), and either
//! `file_version` (3, string) or a `Summary` (5) of `Value`s (1), each a tag (1, string) and a `simple_value` (2, float).

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;

use super::metrics::{ProgressLogger, Scalars};
use crate::data::plain_file;

/// Appends every step that has numbers to an event file, and passes everything on.
pub(crate) struct TensorBoard<'a> {
    path: PathBuf,
    file: File,
    next: &'a mut dyn ProgressLogger,
}

impl<'a> TensorBoard<'a> {
    /// Begins a new event file in `folder`; TensorBoard reads all of a folder as one.
    ///
    /// # Errors
    /// When it cannot be written to.
    pub(crate) fn open(folder: &Path, next: &'a mut dyn ProgressLogger) -> anyhow::Result<TensorBoard<'a>> {
        let now = now();
        let path = folder.join(format!("events.out.tfevents.{now:.6}.sprint"));
        let open = || -> std::io::Result<File> {
            let mut file = plain_file::append(&path)?;
            file.write_all(&record(&event(now, 0, &text(3, "brain.Event:2"))))?;
            Ok(file)
        };
        let file = open().with_context(|| format!("{} cannot be written to", path.display()))?;
        Ok(TensorBoard { path, file, next })
    }
}

impl ProgressLogger for TensorBoard<'_> {
    fn log(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
        if !scalars.values.is_empty() {
            let mut summary = Vec::new();
            for (name, &value) in &scalars.values {
                let tag = text(1, &format!("{}/{name}", scalars.stage));
                summary.extend(message(1, &[tag, float(2, value as f32)].concat()));
            }
            let written = self.file.write_all(&record(&event(now(), scalars.step, &message(5, &summary))));
            written.with_context(|| format!("{} cannot be written to", self.path.display()))?;
        }
        self.next.log(scalars)
    }
}

/// Seconds since 1970; only for TensorBoard's axis.
fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

fn event(time: f64, step: u64, what: &[u8]) -> Vec<u8> {
    let mut bytes = vec![(1 << 3) | 1];
    bytes.extend(time.to_le_bytes());
    bytes.push(2 << 3);
    bytes.extend(varint(step));
    bytes.extend(what);
    bytes
}

fn text(field: u8, text: &str) -> Vec<u8> {
    message(field, text.as_bytes())
}

fn message(field: u8, content: &[u8]) -> Vec<u8> {
    let mut bytes = vec![(field << 3) | 2];
    bytes.extend(varint(content.len() as u64));
    bytes.extend(content);
    bytes
}

fn float(field: u8, value: f32) -> Vec<u8> {
    let mut bytes = vec![(field << 3) | 5];
    bytes.extend(value.to_le_bytes());
    bytes
}

fn varint(mut number: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
    bytes
}

fn record(data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    let mut bytes = length.to_vec();
    bytes.extend(masked(crc32c(&length)).to_le_bytes());
    bytes.extend(data);
    bytes.extend(masked(crc32c(data)).to_le_bytes());
    bytes
}

/// The format's guard against checksums of checksums.
fn masked(crc: u32) -> u32 {
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}

/// CRC-32C (Castagnoli), a bit at a time: events are few and small.
fn crc32c(bytes: &[u8]) -> u32 {
    let crc = bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0x82f6_3b78 } else { crc >> 1 })
    });
    !crc
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Nobody;

    impl ProgressLogger for Nobody {
        fn log(&mut self, _: &Scalars) -> anyhow::Result<()> {
            Ok(())
        }
    }

    /// Reads records, checking both sums.
    fn records(mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        while !bytes.is_empty() {
            let (length, rest) = bytes.split_at(8);
            let size = u64::from_le_bytes(length.try_into().unwrap()) as usize;
            assert_eq!(rest[..4], masked(crc32c(length)).to_le_bytes());
            let data = &rest[4..4 + size];
            assert_eq!(rest[4 + size..8 + size], masked(crc32c(data)).to_le_bytes());
            found.push(data.to_vec());
            bytes = &rest[8 + size..];
        }
        found
    }

    /// The fields of a protocol buffer: number and bytes (a varint as 8 bytes).
    fn fields(mut bytes: &[u8]) -> Vec<(u8, Vec<u8>)> {
        fn number(bytes: &mut &[u8]) -> u64 {
            let mut number = 0;
            for shift in (0..).step_by(7) {
                let byte = bytes[0];
                *bytes = &bytes[1..];
                number |= u64::from(byte & 0x7f) << shift;
                if byte < 0x80 {
                    break;
                }
            }
            number
        }
        let mut found = Vec::new();
        while !bytes.is_empty() {
            let key = number(&mut bytes) as u8;
            let size = match key & 7 {
                0 => {
                    found.push((key >> 3, number(&mut bytes).to_le_bytes().to_vec()));
                    continue;
                }
                1 => 8,
                5 => 4,
                _ => number(&mut bytes) as usize,
            };
            found.push((key >> 3, bytes[..size].to_vec()));
            bytes = &bytes[size..];
        }
        found
    }

    #[test]
    fn the_checksum_is_the_published_one() {
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
    }

    #[test]
    fn what_is_written_parses_back() {
        let folder = tempfile::tempdir().unwrap();
        let mut nobody = Nobody;
        let mut events = TensorBoard::open(folder.path(), &mut nobody).unwrap();
        let mut scalars = Scalars::new("policy", 300, 1000);
        events.log(&scalars).unwrap();
        scalars.set("q_loss", 0.25);
        scalars.set("v_mean", -1.5);
        events.log(&scalars).unwrap();
        let path = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
        assert!(path.file_name().unwrap().to_string_lossy().starts_with("events.out.tfevents."));
        let records = records(&std::fs::read(path).unwrap());
        assert_eq!(records.len(), 2, "a step without numbers is no event");
        assert_eq!(fields(&records[0])[2], (3, b"brain.Event:2".to_vec()));
        let event = fields(&records[1]);
        assert_eq!(event[1], (2, 300u64.to_le_bytes().to_vec()));
        let values = fields(&event[2].1).into_iter().map(|(_, value)| {
            let parts = fields(&value);
            let number = f32::from_le_bytes(parts[1].1[..].try_into().unwrap());
            (String::from_utf8(parts[0].1.clone()).unwrap(), number)
        });
        assert_eq!(
            values.collect::<Vec<_>>(),
            [("policy/q_loss".to_string(), 0.25), ("policy/v_mean".to_string(), -1.5)]
        );
    }
}
