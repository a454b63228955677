//! Feature files: one feature map a frame, 16-bit floats, computed once by whoever owns the encoder, read from the disk as needed.

use std::fs::{File, TryLockError};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};

use super::locked_file::LockedFile;
use super::{folder, plain_file};

/// What a feature file holds; its first line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureHeader {
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

impl FeatureHeader {
    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 1;

    /// The file's name in a dataset's `cache` folder.
    pub fn file_name(&self) -> String {
        format!("features-{}-{}.bin", self.encoder, self.dataset)
    }

    /// Bytes of a map.
    fn width(&self) -> usize {
        2 * self.numbers as usize
    }

    fn line(&self) -> anyhow::Result<Vec<u8>> {
        let mut line = serde_json::to_vec(self)?;
        line.push(b'\n');
        Ok(line)
    }
}

/// The maps of datasets, one after the other. They stay in their files; what is read often stays in the system's page cache.
pub struct Features {
    files: Vec<MapFile>,
    /// Bytes of a map.
    width: usize,
}

struct MapFile {
    file: File,
    path: PathBuf,
    /// Where the first one begins.
    offset: u64,
    /// The numbers of these maps among all.
    range: Range<usize>,
}

impl Features {
    /// Opens a feature file, if it is there and whole and holds what `wanted` says.
    ///
    /// # Errors
    /// When the file is there but cannot be read.
    pub fn read(folder: &Path, wanted: &FeatureHeader) -> anyhow::Result<Option<Features>> {
        let path = folder.join(wanted.file_name());
        let Ok(file) = plain_file::open(&path) else { return Ok(None) };
        let line = wanted.line()?;
        let mut found = Vec::new();
        let context = || format!("{} cannot be read", path.display());
        BufReader::new(&file).read_until(b'\n', &mut found).with_context(context)?;
        let expected = line.len() as u64 + wanted.maps * wanted.width() as u64;
        if found != line || file.metadata().with_context(context)?.len() != expected {
            return Ok(None);
        }
        let maps = MapFile { file, path, offset: line.len() as u64, range: 0..wanted.maps as usize };
        Ok(Some(Features { files: vec![maps], width: wanted.width() }))
    }

    /// Adds the maps of other files of the same encoder after these.
    pub(crate) fn append(&mut self, other: Features) {
        let before = self.len();
        self.files.extend(other.files.into_iter().map(|maps| {
            let range = maps.range.start + before..maps.range.end + before;
            MapFile { range, ..maps }
        }));
    }

    /// Appends the bytes of maps, little-endian 16-bit floats, in any order, with repetitions; those that follow each other in a
    /// file are read at once.
    ///
    /// # Errors
    /// When one of them does not exist or holds what is no number, or the disk fails.
    pub(crate) fn gather_all(&self, maps: impl Iterator<Item = usize>, into: &mut Vec<u8>) -> anyhow::Result<()> {
        let mut run = 0..0;
        for map in maps {
            if map == run.end && !run.is_empty() {
                run.end += 1;
                continue;
            }
            self.gather_run(run, into)?;
            run = map..map + 1;
        }
        self.gather_run(run, into)
    }

    /// Appends the bytes of maps that follow each other.
    ///
    /// # Errors
    /// When one of them does not exist or holds what is no number, or the disk fails.
    pub fn gather_run(&self, mut run: Range<usize>, into: &mut Vec<u8>) -> anyhow::Result<()> {
        while !run.is_empty() {
            let position = self.files.partition_point(|maps| maps.range.end <= run.start);
            let maps = self.files.get(position).with_context(|| format!("there is no feature map {}", run.start))?;
            let end = run.end.min(maps.range.end);
            let filled = into.len();
            into.resize(filled + (end - run.start) * self.width, 0);
            let at = maps.offset + ((run.start - maps.range.start) * self.width) as u64;
            let read = maps.file.read_exact_at(&mut into[filled..], at);
            read.with_context(|| format!("{} cannot be read", maps.path.display()))?;
            if let Some(map) = not_finite(&into[filled..], self.width) {
                bail!(
                    "{}: feature map {} holds NaN or an infinite number: delete the file, and it is computed anew",
                    maps.path.display(),
                    run.start + map - maps.range.start
                );
            }
            run.start = end;
        }
        Ok(())
    }

    /// Bytes of a map.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// How many maps there are.
    pub fn len(&self) -> usize {
        self.files.last().map_or(0, |maps| maps.range.end)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The first of these maps that holds NaN or an infinity.
fn not_finite(bytes: &[u8], width: usize) -> Option<usize> {
    // Of a little-endian 16-bit float, all bits of the exponent are set. Without a branch, it is as fast as the memory.
    let any = |bytes: &[u8]| bytes.chunks_exact(2).fold(false, |any, pair| any | (pair[1] & 0x7c == 0x7c));
    any(bytes).then(|| bytes.chunks(width.max(1)).position(any)).flatten()
}

/// Writes a feature file; it appears when it is whole. What an earlier, interrupted writer left is taken up.
pub struct FeatureWriter {
    header: FeatureHeader,
    folder: PathBuf,
    file: LockedFile,
    /// Bytes before the first map.
    offset: u64,
    maps: u64,
    unsynced: usize,
}

/// Bytes between two moments at which everything written so far is on the disk.
const DURABLE: usize = 64 << 20;

impl FeatureWriter {
    /// Opens the unfinished file in `folder`, which is made if need be, or begins one.
    ///
    /// # Errors
    /// When the folder cannot be written to, or another process writes the same file.
    pub fn open(folder: &Path, header: FeatureHeader) -> anyhow::Result<FeatureWriter> {
        let path = folder.join(header.file_name() + ".part");
        let context = || format!("{} cannot be written", path.display());
        folder::make(folder).with_context(context)?;
        let options = plain_file::change(&path);
        let mut file = match LockedFile::lock(options.with_context(context)?) {
            Err(TryLockError::WouldBlock) => bail!("{}: another process is writing to it", path.display()),
            Err(TryLockError::Error(error)) => return Err(error).with_context(context),
            Ok(file) => file,
        };
        let line = header.line()?;
        let mut found = Vec::new();
        BufReader::new(&*file).read_until(b'\n', &mut found).with_context(context)?;
        let offset = line.len() as u64;
        if found != line {
            file.set_len(0).with_context(context)?;
            file.seek(SeekFrom::Start(0)).and_then(|_| file.write_all(&line)).with_context(context)?;
        }
        let length = file.metadata().with_context(context)?.len();
        let maps = (length - offset) / (header.width() as u64).max(1);
        let mut writer = FeatureWriter { header, folder: folder.to_owned(), file, offset, maps: 0, unsynced: 0 };
        writer.keep(maps)?;
        Ok(writer)
    }

    /// How many maps are in the file.
    pub(crate) fn maps(&self) -> u64 {
        self.maps
    }

    /// Drops what comes after that many maps.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn keep(&mut self, maps: u64) -> anyhow::Result<()> {
        let end = self.offset + maps * self.header.width() as u64;
        self.file.set_len(end).and_then(|()| self.file.seek(SeekFrom::Start(end))).with_context(|| self.complaint())?;
        self.maps = maps;
        Ok(())
    }

    /// Adds whole maps: little-endian 16-bit floats.
    ///
    /// # Errors
    /// When they are not whole, or the disk is full.
    pub fn add(&mut self, bytes: &[u8]) -> anyhow::Result<()> {
        let width = self.header.width().max(1);
        anyhow::ensure!(bytes.len().is_multiple_of(width), "{} bytes are no whole maps of {width}", bytes.len());
        if let Some(map) = not_finite(bytes, width) {
            bail!("the encoder's feature map {} holds NaN or an infinite number", self.maps + map as u64);
        }
        self.file.write_all(bytes).with_context(|| self.complaint())?;
        self.maps += (bytes.len() / width) as u64;
        self.unsynced += bytes.len();
        if self.unsynced >= DURABLE {
            self.file.sync_data().with_context(|| self.complaint())?;
            self.unsynced = 0;
        }
        Ok(())
    }

    /// Puts the file in place.
    ///
    /// # Errors
    /// When another number of maps was added than the header says, or the disk is full.
    pub fn finish(self) -> anyhow::Result<()> {
        let (found, expected) = (self.maps, self.header.maps);
        anyhow::ensure!(found == expected, "{found} feature maps were computed, not {expected}");
        self.file.sync_all().with_context(|| self.complaint())?;
        let path = self.folder.join(self.header.file_name());
        std::fs::rename(self.part(), path).with_context(|| self.complaint())
    }

    fn part(&self) -> PathBuf {
        self.folder.join(self.header.file_name() + ".part")
    }

    fn complaint(&self) -> String {
        format!("{} cannot be written", self.part().display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> FeatureHeader {
        FeatureHeader { format_version: 1, encoder: "e".into(), dataset: "d".into(), maps: 2, numbers: 3 }
    }

    fn write(folder: &Path, header: FeatureHeader, bytes: &[u8]) {
        let mut writer = FeatureWriter::open(folder, header).unwrap();
        writer.add(bytes).unwrap();
        writer.finish().unwrap();
    }

    #[test]
    fn maps_come_back_and_a_file_for_other_data_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), header(), &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
        let features = Features::read(folder.path(), &header()).unwrap().unwrap();
        let mut bytes = Vec::new();
        features.gather_all([1].into_iter(), &mut bytes).unwrap();
        assert_eq!((features.len(), bytes), (2, vec![7, 8, 9, 10, 11, 12]));
        assert!(Features::read(folder.path(), &FeatureHeader { maps: 3, ..header() }).unwrap().is_none());
    }

    #[test]
    fn maps_are_gathered_in_any_order_and_over_files() {
        let folder = tempfile::tempdir().unwrap();
        let named = |dataset: &str| FeatureHeader { dataset: dataset.into(), numbers: 1, ..header() };
        write(folder.path(), named("one"), &[1, 0, 2, 0]);
        write(folder.path(), named("two"), &[3, 0, 4, 0]);
        let mut features = Features::read(folder.path(), &named("one")).unwrap().unwrap();
        features.append(Features::read(folder.path(), &named("two")).unwrap().unwrap());
        assert_eq!(features.len(), 4);
        let gathered = |maps: &[usize]| {
            let mut bytes = Vec::new();
            let gathered = features.gather_all(maps.iter().copied(), &mut bytes);
            gathered.map(|()| bytes.into_iter().step_by(2).collect::<Vec<u8>>())
        };
        assert_eq!(gathered(&[0, 0, 0, 1, 2]).unwrap(), [1, 1, 1, 2, 3]);
        assert_eq!(gathered(&[3, 0, 1, 2, 3]).unwrap(), [4, 1, 2, 3, 4]);
        assert!(gathered(&[]).unwrap().is_empty());
        assert!(gathered(&[2, 3, 4]).is_err());
    }

    #[test]
    fn maps_that_hold_what_is_no_number_are_neither_written_nor_read() {
        let folder = tempfile::tempdir().unwrap();
        let one = FeatureHeader { numbers: 1, ..header() };
        for number in [0x7e00_u16, 0x7c00, 0xfc00] {
            let bytes = [[0x00, 0x3c], number.to_le_bytes()].concat();
            let told = FeatureWriter::open(folder.path(), one.clone()).unwrap().add(&bytes).unwrap_err().to_string();
            assert!(told.contains("feature map 1 "), "{told}");
            std::fs::write(folder.path().join(one.file_name()), [one.line().unwrap(), bytes].concat()).unwrap();
            let features = Features::read(folder.path(), &one).unwrap().unwrap();
            features.gather_run(0..1, &mut Vec::new()).unwrap();
            let told = features.gather_run(0..2, &mut Vec::new()).unwrap_err().to_string();
            assert!(told.contains("features-e-d.bin: feature map 1 ") && told.contains("delete"), "{told}");
        }
        // The largest numbers of 16 bits, and what is least.
        write(folder.path(), FeatureHeader { encoder: "f".into(), ..one }, &[0xff, 0x7b, 0xff, 0xfb]);
    }

    #[test]
    fn a_short_file_is_never_put_in_place_and_is_taken_up_again() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = FeatureWriter::open(folder.path(), header()).unwrap();
        writer.add(&[1, 2, 3, 4, 5, 6]).unwrap();
        assert!(FeatureWriter::open(folder.path(), header()).is_err(), "one process writes at a time");
        assert!(writer.finish().is_err());
        assert!(Features::read(folder.path(), &header()).unwrap().is_none());
        // Half a map more, as a killed writer leaves it.
        let part = folder.path().join("features-e-d.bin.part");
        std::fs::OpenOptions::new().append(true).open(&part).unwrap().write_all(&[7, 7, 7]).unwrap();
        let mut writer = FeatureWriter::open(folder.path(), header()).unwrap();
        assert_eq!(writer.maps(), 1);
        writer.add(&[7, 8, 9, 10, 11, 12]).unwrap();
        writer.finish().unwrap();
        let mut bytes = Vec::new();
        Features::read(folder.path(), &header()).unwrap().unwrap().gather_run(0..2, &mut bytes).unwrap();
        assert_eq!(bytes, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
        assert!(!part.exists());
    }

    #[test]
    fn what_is_left_of_other_data_is_not_taken_up() {
        let folder = tempfile::tempdir().unwrap();
        FeatureWriter::open(folder.path(), header()).unwrap().add(&[0; 6]).unwrap();
        let other = FeatureHeader { numbers: 1, ..header() };
        assert_eq!(FeatureWriter::open(folder.path(), other).unwrap().maps(), 0);
    }
}
