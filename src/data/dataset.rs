//! A dataset folder: `dataset.json`, `scenes/*.json`, `trajectories.jsonl.zst`, `tasks/*.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::folder_lock::FolderLock;
use super::{atomic_file, folder, json, plain_file, taskset, text_file};
use crate::domain::{Scene, TaskSet, Trajectory};
use crate::house::validate;

/// The file of a dataset's trajectories.
const TRAJECTORIES: &str = "trajectories.jsonl.zst";

/// How much of a split there is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Counts {
    pub(crate) trajectories: u64,
    /// Skills, once for each annotation of their trajectory.
    pub(crate) annotated_primitives: u64,
    /// Those whose annotation has one sentence a skill.
    pub(crate) aligned_primitives: u64,
    /// Runs of two or more skills, once for each annotation.
    pub(crate) spans: u64,
    /// Those with aligned annotations, without the held-out whole trajectories.
    pub(crate) spans_after_holdout: u64,
}

/// A file that was passed over.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Skipped {
    /// The file, relative to what was imported.
    pub(crate) file: String,
    /// What was wrong with it.
    pub(crate) reason: String,
}

/// `dataset.json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DatasetManifest {
    pub(crate) format_version: u32,
    /// Where it came from: `alfred`, `generated`.
    pub(crate) source: String,
    /// Counts by split.
    pub(crate) counts: BTreeMap<String, Counts>,
    pub(crate) scenes: u64,
    /// Trajectories of which the whole must not be trained on as one span.
    pub(crate) held_out: Vec<String>,
    /// Files that were passed over when it was made.
    pub(crate) skipped: Vec<Skipped>,
}

impl DatasetManifest {
    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 1;
}

/// A dataset folder, opened.
#[derive(Clone, Debug)]
pub struct Dataset {
    folder: PathBuf,
    manifest: DatasetManifest,
}

impl Dataset {
    /// Opens a dataset folder.
    ///
    /// # Errors
    /// When `dataset.json` is absent, malformed, or of another version.
    pub fn open(folder: &Path) -> anyhow::Result<Dataset> {
        let path = folder.join("dataset.json");
        anyhow::ensure!(
            path.exists(),
            "{} is no dataset (dataset.json is missing); `sprint import` or `sprint collect` makes one",
            folder.display()
        );
        let manifest = json::read::<DatasetManifest>(&path, DatasetManifest::FORMAT)?.value;
        Ok(Dataset { folder: folder.to_owned(), manifest })
    }

    /// Whether it holds trajectories of that split.
    ///
    /// # Errors
    /// Names the splits that it holds.
    pub(crate) fn check_split(&self, split: &str) -> anyhow::Result<()> {
        let counts = self.manifest.counts.iter().filter(|(_, counts)| counts.trajectories > 0);
        let known: Vec<&str> = counts.map(|(name, _)| name.as_str()).collect();
        anyhow::ensure!(
            known.contains(&split),
            "{} holds no split {split:?}; it holds {}",
            self.folder.display(),
            known.join(", ")
        );
        Ok(())
    }

    /// What `dataset.json` says.
    pub(crate) fn manifest(&self) -> &DatasetManifest {
        &self.manifest
    }

    /// Where it lies.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Reads the scene of that name.
    ///
    /// # Errors
    /// When its file is absent, malformed, of another version, or without cells.
    pub(crate) fn scene(&self, name: &str) -> anyhow::Result<Arc<Scene>> {
        read_scene(&self.folder.join("scenes"), name).map(Arc::new)
    }

    /// The names of all scenes, sorted.
    ///
    /// # Errors
    /// When the folder cannot be listed.
    pub(crate) fn scene_names(&self) -> anyhow::Result<Vec<String>> {
        let folder = self.folder.join("scenes");
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            if path.extension().is_some_and(|extension| extension == "json") {
                names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
            }
        }
        names.sort();
        Ok(names)
    }

    /// Reads all scenes, by name.
    ///
    /// # Errors
    /// As [`Dataset::scene`].
    pub(crate) fn scenes(&self) -> anyhow::Result<BTreeMap<String, Arc<Scene>>> {
        self.scene_names()?.into_iter().map(|name| Ok((name.clone(), self.scene(&name)?))).collect()
    }

    /// Reads the trajectories one after another.
    ///
    /// # Errors
    /// When the file is absent; each item can also fail, naming the line.
    pub fn trajectories(&self) -> anyhow::Result<impl Iterator<Item = anyhow::Result<Trajectory>> + Send + use<>> {
        let path = self.folder.join(TRAJECTORIES);
        let file = plain_file::open(&path).with_context(|| path.display().to_string())?;
        let reader = BufReader::new(zstd::Decoder::new(file)?);
        Ok(reader.lines().enumerate().map(move |(number, line)| {
            let place = || format!("{}, line {}", path.display(), number + 1);
            let line = line.with_context(place)?;
            let trajectory: Trajectory = serde_json::from_str(text_file::line(&line)).with_context(place)?;
            trajectory.check().map_err(anyhow::Error::msg).with_context(place)?;
            Ok(trajectory)
        }))
    }

    /// Keeps the wholes of these trajectories from every later training.
    ///
    /// # Errors
    /// When another process writes the dataset, or it cannot be read or written.
    pub(crate) fn withhold(&self, wholes: &BTreeSet<&str>) -> anyhow::Result<()> {
        let _taken = FolderLock::take(&self.folder)?;
        let mut manifest = Dataset::open(&self.folder)?.manifest;
        for trajectory in self.trajectories()? {
            let trajectory = trajectory?;
            if !wholes.contains(trajectory.id.as_str()) || manifest.held_out.contains(&trajectory.id) {
                continue;
            }
            let skills = trajectory.skills.len();
            let aligned = trajectory.annotations.iter().filter(|annotation| annotation.steps.len() == skills).count();
            if let Some(counts) = manifest.counts.get_mut(&trajectory.split).filter(|_| skills > 1) {
                counts.spans_after_holdout = counts.spans_after_holdout.saturating_sub(aligned as u64);
            }
            manifest.held_out.push(trajectory.id);
        }
        json::write(&self.folder.join("dataset.json"), &manifest)
    }

    /// Identifies the trajectories: the first 16 digits of the sha256 of their file.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub(crate) fn digest(&self) -> anyhow::Result<String> {
        let path = self.folder.join(TRAJECTORIES);
        let mut file = plain_file::open(&path).with_context(|| path.display().to_string())?;
        let mut hash = Sha256::new();
        std::io::copy(&mut file, &mut hash).with_context(|| path.display().to_string())?;
        Ok(format!("{:x}", hash.finalize())[..16].to_string())
    }

    /// Reads a task set of the dataset, e.g. `eval_100`.
    ///
    /// # Errors
    /// When its file is absent, malformed, or of another version.
    pub(crate) fn tasks(&self, name: &str) -> anyhow::Result<TaskSet> {
        Ok(taskset::read(&self.folder.join("tasks").join(format!("{name}.json")))?.value)
    }
}

/// Reads the scene of that name from a folder of scene files.
///
/// # Errors
/// When its file is absent, malformed, of another version, or no scene that can be lived in.
pub fn read_scene(folder: &Path, name: &str) -> anyhow::Result<Scene> {
    let plain = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
    ensure!(plain, "{name:?} is not the name of a scene");
    let path = folder.join(format!("{name}.json"));
    let scene: Scene = json::read(&path, Scene::FORMAT)?.value;
    validate::scene(&scene).with_context(|| path.display().to_string())?;
    ensure!(scene.name == name, "{}: name: {:?} is not the file's name", path.display(), scene.name);
    Ok(scene)
}

/// Writes a dataset folder. `dataset.json` comes last: a folder without it is not a dataset.
pub(crate) struct DatasetWriter {
    folder: FolderLock,
    trajectories: zstd::Encoder<'static, tempfile::NamedTempFile>,
}

impl DatasetWriter {
    /// Starts a dataset in `folder`, which is made when absent. An earlier dataset there is replaced.
    ///
    /// # Errors
    /// When the folder cannot be made or written, or another process writes it.
    pub(crate) fn new(folder: &Path) -> anyhow::Result<DatasetWriter> {
        DatasetWriter::into_folder(FolderLock::take(folder)?)
    }

    /// The same in a folder that was taken before.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn into_folder(taken: FolderLock) -> anyhow::Result<DatasetWriter> {
        let folder = taken.folder();
        atomic_file::remove_unfinished(folder);
        for part in ["scenes", "tasks"] {
            let part = folder.join(part);
            folder::make(&part).with_context(|| part.display().to_string())?;
            atomic_file::remove_unfinished(&part);
        }
        let old = folder.join("dataset.json");
        if old.exists() {
            std::fs::remove_file(&old).with_context(|| old.display().to_string())?;
        }
        let file = atomic_file::begin(&folder.join(TRAJECTORIES)).with_context(|| folder.display().to_string())?;
        let trajectories = zstd::Encoder::new(file, 6)?;
        Ok(DatasetWriter { folder: taken, trajectories })
    }

    /// Writes a scene.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn scene(&self, scene: &Scene) -> anyhow::Result<()> {
        json::write(&self.folder.folder().join("scenes").join(format!("{}.json", scene.name)), scene)
    }

    /// Appends a trajectory.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn trajectory(&mut self, trajectory: &Trajectory) -> anyhow::Result<()> {
        serde_json::to_writer(&mut self.trajectories, trajectory)?;
        self.trajectories.write_all(b"\n")?;
        Ok(())
    }

    /// Writes a task set under `tasks/`.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn tasks(&self, file: &str, set: &TaskSet) -> anyhow::Result<()> {
        json::write(&self.folder.folder().join("tasks").join(format!("{file}.json")), set)
    }

    /// Completes the dataset.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(crate) fn finish(self, manifest: &DatasetManifest) -> anyhow::Result<()> {
        let folder = self.folder.folder();
        let path = folder.join(TRAJECTORIES);
        let file = self.trajectories.finish()?;
        atomic_file::keep(file, &path).with_context(|| path.display().to_string())?;
        json::write(&folder.join("dataset.json"), manifest)
    }
}

/// Manifests for tests.
#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    /// Of a test's dataset, without counts.
    pub(crate) fn manifest(scenes: u64, held_out: &[&str]) -> DatasetManifest {
        DatasetManifest {
            format_version: DatasetManifest::FORMAT,
            source: "test".into(),
            counts: BTreeMap::new(),
            scenes,
            held_out: held_out.iter().map(ToString::to_string).collect(),
            skipped: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Cell, Room};

    fn scene() -> Scene {
        Scene {
            format_version: Scene::FORMAT,
            name: "hall".into(),
            room: Room::Bedroom,
            agent_y: 900,
            cells: vec![Cell::new(0, 0)],
            fixtures: vec![],
            walls: vec![],
            meshes: vec![],
        }
    }

    fn manifest() -> DatasetManifest {
        let counts = BTreeMap::from([("train".to_owned(), Counts { trajectories: 1, ..Counts::default() })]);
        DatasetManifest {
            format_version: 1,
            source: "alfred".into(),
            counts,
            scenes: 1,
            held_out: vec![],
            skipped: vec![],
        }
    }

    #[test]
    fn what_a_killed_process_left_half_written_goes_with_the_next_one() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("scenes")).unwrap();
        let left = [".sprint-a1b2c3", "scenes/.sprint-d4e5f6"].map(|name| folder.path().join(name));
        left.iter().for_each(|path| std::fs::write(path, "half").unwrap());
        let writer = DatasetWriter::new(folder.path()).unwrap();
        writer.scene(&scene()).unwrap();
        assert!(left.iter().all(|path| !path.exists()));
    }

    #[test]
    fn what_is_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let writer = DatasetWriter::new(folder.path()).unwrap();
        writer.scene(&scene()).unwrap();
        writer.finish(&manifest()).unwrap();
        let dataset = Dataset::open(folder.path()).unwrap();
        assert_eq!(dataset.manifest(), &manifest());
        assert_eq!(*dataset.scene("hall").unwrap(), scene());
        assert_eq!(dataset.scene_names().unwrap(), ["hall"]);
        assert_eq!(dataset.trajectories().unwrap().count(), 0);
    }

    #[test]
    fn two_that_write_one_dataset_at_once_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let first = DatasetWriter::new(folder.path()).unwrap();
        let told = DatasetWriter::new(folder.path()).err().unwrap().to_string();
        assert!(told.contains("another process"), "{told}");
        first.finish(&manifest()).unwrap();
        assert!(DatasetWriter::new(folder.path()).is_ok());
    }

    #[test]
    fn an_unfinished_dataset_is_no_dataset() {
        let folder = tempfile::tempdir().unwrap();
        DatasetWriter::new(folder.path()).unwrap().scene(&scene()).unwrap();
        assert!(Dataset::open(folder.path()).is_err());
    }

    #[test]
    fn another_version_an_unknown_field_and_a_scene_without_cells_are_errors_that_name_file_and_field() {
        let folder = tempfile::tempdir().unwrap();
        let empty = Scene { cells: vec![], ..scene() };
        json::write(&folder.path().join("hall.json"), &empty).unwrap();
        let text = |error: anyhow::Error| format!("{error:#}");
        let error = text(read_scene(folder.path(), "hall").unwrap_err());
        assert!(error.contains("hall.json") && error.contains("cells"), "{error}");
        json::write(&folder.path().join("hall.json"), &Scene { format_version: 9, ..scene() }).unwrap();
        let error = text(read_scene(folder.path(), "hall").unwrap_err());
        assert!(error.contains("hall.json") && error.contains("format_version") && error.contains('9'), "{error}");
        std::fs::write(folder.path().join("hall.json"), r#"{"format_version": 1, "colour": 3}"#).unwrap();
        let error = text(read_scene(folder.path(), "hall").unwrap_err());
        assert!(error.contains("hall.json") && error.contains("colour"), "{error}");
        assert!(read_scene(folder.path(), "../hall").is_err());
    }
}
