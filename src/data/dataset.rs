//! The dataset folder: `dataset.json`, `scenes/*.json`, `trajectories.jsonl.zst`.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::domain::{Scene, Trajectory};

/// `dataset.json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of this format.
    pub format_version: u32,
    /// Where it comes from, in words.
    pub source: String,
    /// How many trajectories it holds.
    pub trajectories: u64,
}

/// A dataset folder that was opened.
#[derive(Clone, Debug)]
pub struct Dataset {
    folder: PathBuf,
    manifest: Manifest,
}

impl Dataset {
    /// The format version this program reads and writes.
    pub const FORMAT: u32 = 1;

    /// Opens a dataset.
    ///
    /// # Errors
    /// When the folder is no dataset, or one of another format version.
    pub fn open(folder: &Path) -> anyhow::Result<Dataset> {
        let path = folder.join("dataset.json");
        let text = std::fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        let manifest: Manifest =
            serde_json::from_str(&text).with_context(|| format!("{} is malformed", path.display()))?;
        anyhow::ensure!(
            manifest.format_version == Dataset::FORMAT,
            "{}: format_version is {}, this program reads {}",
            path.display(),
            manifest.format_version,
            Dataset::FORMAT
        );
        Ok(Dataset { folder: folder.to_path_buf(), manifest })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// `dataset.json`.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// A scene by name.
    ///
    /// # Errors
    /// When its file is missing or malformed.
    pub fn scene(&self, name: &str) -> anyhow::Result<Scene> {
        let path = self.folder.join("scenes").join(format!("{name}.json"));
        let text = std::fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{} is malformed", path.display()))
    }

    /// Every trajectory, in the order of the file.
    ///
    /// # Errors
    /// When the file is missing; each item when its line cannot be read.
    pub fn trajectories(&self) -> anyhow::Result<impl Iterator<Item = anyhow::Result<Trajectory>>> {
        let path = self.folder.join("trajectories.jsonl.zst");
        let file = File::open(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        let lines = BufReader::new(zstd::Decoder::new(file)?).lines();
        Ok(lines.enumerate().map(move |(i, line)| {
            line.map_err(anyhow::Error::from)
                .and_then(|line| Ok(serde_json::from_str(&line)?))
                .with_context(|| format!("{} line {} cannot be read", path.display(), i + 1))
        }))
    }

    /// The first 16 digits of the sha256 of the trajectories' file.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn digest(&self) -> anyhow::Result<String> {
        let path = self.folder.join("trajectories.jsonl.zst");
        let mut file = File::open(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        let mut digest = Sha256::new();
        std::io::copy(&mut file, &mut digest)?;
        Ok(format!("{:x}", digest.finalize())[..16].to_string())
    }
}

/// Writes a dataset of trajectories one by one; nothing counts until [`Writer::finish`].
pub struct Writer {
    folder: PathBuf,
    lines: zstd::Encoder<'static, BufWriter<tempfile::NamedTempFile>>,
    written: u64,
}

impl Writer {
    /// Begins a dataset in a folder, which is made if need be.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub fn create(folder: &Path) -> anyhow::Result<Writer> {
        let begin = || -> anyhow::Result<Writer> {
            std::fs::create_dir_all(folder)?;
            let file = BufWriter::new(tempfile::NamedTempFile::new_in(folder)?);
            Ok(Writer { folder: folder.to_path_buf(), lines: zstd::Encoder::new(file, 3)?, written: 0 })
        };
        begin().with_context(|| format!("{} cannot be written to", folder.display()))
    }

    /// Adds a trajectory.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn add(&mut self, trajectory: &Trajectory) -> anyhow::Result<()> {
        serde_json::to_writer(&mut self.lines, trajectory)?;
        self.lines.write_all(b"\n")?;
        self.written += 1;
        Ok(())
    }

    /// Puts the dataset in place.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn finish(self, source: String) -> anyhow::Result<Dataset> {
        let manifest = Manifest { format_version: Dataset::FORMAT, source, trajectories: self.written };
        let file = self.lines.finish()?.into_inner().map_err(std::io::IntoInnerError::into_error)?;
        file.persist(self.folder.join("trajectories.jsonl.zst"))?;
        let mut temporary = tempfile::NamedTempFile::new_in(&self.folder)?;
        temporary.write_all(serde_json::to_string_pretty(&manifest)?.as_bytes())?;
        temporary.persist(self.folder.join("dataset.json"))?;
        Dataset::open(&self.folder)
    }
}
