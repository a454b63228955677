//! An ALFRED checkout: its files are found, read and checked.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, bail};
use rayon::prelude::*;

use super::files::{SceneOnly, TrajData};
use super::presence;
use super::recording::{RecordedStart, Recording};
use crate::data::dataset::Skipped;
use crate::data::{plain_file, text_file};

/// A `traj_data.json` of a checkout.
pub(super) struct SourceFile {
    path: PathBuf,
    /// Relative to the checkout, for messages.
    shown: String,
    split: String,
    id: String,
}

enum Parsed {
    Recording(Box<Recording>),
    RecordedStart(RecordedStart),
}

/// The folders of a checkout that ALFRED publishes.
const SPLITS: [&str; 5] = ["train", "valid_seen", "valid_unseen", "tests_seen", "tests_unseen"];
/// What each trial's folder holds.
const FILE: &str = "traj_data.json";

/// Every `traj_data.json` of the checkout, and what stands where one should be.
pub(super) fn find(source: &Path) -> anyhow::Result<(Vec<SourceFile>, Vec<Skipped>)> {
    let folders = ["data/json_2.1.0", "data/full_2.1.0", "data/json_feat_2.1.0"];
    let Some(data) = folders.iter().map(|folder| source.join(folder)).find(|folder| folder.is_dir()) else {
        bail!(
            "{} is no ALFRED checkout: it has no folder data/json_2.1.0 (see the dataset's download script)",
            source.display()
        );
    };
    let mut found = Found { source, files: Vec::new(), skipped: Vec::new() };
    let (mut files, mut astray) = (Vec::new(), Vec::new());
    for split in found.folders_in(&data)? {
        let name = split.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        found.look_in(&split, &name);
        // A split of one's own holds tasks that hold trials; a folder that holds less is no split.
        let is_split = |file: &SourceFile| SPLITS.contains(&file.split.as_str()) || file.id.matches('/').count() == 1;
        let (placed, other): (Vec<_>, Vec<_>) = found.files.drain(..).partition(is_split);
        files.extend(placed);
        astray.extend(other);
    }
    let splits = SPLITS.join(", ");
    if let (true, Some(file)) = (files.is_empty(), astray.first()) {
        bail!(
            "{} holds no folder of a split ({splits}): {} lies outside of any; put each file at SPLIT/TASK/TRIAL/{FILE}",
            data.display(),
            file.shown
        );
    }
    let mut skipped = found.skipped;
    skipped.extend(
        astray.into_iter().map(|file| Skipped { file: file.shown, reason: format!("lies in no split ({splits})") }),
    );
    if files.is_empty() {
        let why = skipped.first().map(|skip| format!(" that can be read; {}: {}", skip.file, skip.reason));
        bail!("{} holds no {FILE}{}", data.display(), why.unwrap_or_default());
    }
    files.sort_by(|a, b| a.shown.cmp(&b.shown));
    Ok((files, skipped))
}

/// What a search of a checkout finds.
struct Found<'a> {
    source: &'a Path,
    files: Vec<SourceFile>,
    skipped: Vec<Skipped>,
}

impl Found<'_> {
    /// Finds the files of a split.
    fn look_in(&mut self, split: &Path, name: &str) {
        let mut open = vec![(split.to_owned(), 0)];
        while let Some((folder, depth)) = open.pop() {
            let path = folder.join(FILE);
            match presence::is_file(&path) {
                Ok(true) => {
                    let shown = self.shown(&path);
                    let id = folder.strip_prefix(split).unwrap_or(&folder).to_string_lossy().replace('\\', "/");
                    self.files.push(SourceFile { path, shown, split: name.to_owned(), id });
                    continue;
                }
                Err(reason) => {
                    self.skip(&path, reason);
                    continue;
                }
                Ok(false) => {}
            }
            if folder.file_name().is_some_and(|name| name.to_string_lossy().starts_with("trial_")) {
                self.skip(&folder, format!("holds no {FILE}"));
            } else if depth < 3 {
                match self.folders_in(&folder) {
                    Ok(inner) => open.extend(inner.into_iter().map(|inner| (inner, depth + 1))),
                    Err(error) => self.skip(&folder, error.root_cause().to_string()),
                }
            }
        }
    }

    /// The folders in one; links that lead nowhere are skipped by name, for they may have led to one.
    fn folders_in(&mut self, folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
        let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
        let mut folders = Vec::new();
        for entry in entries {
            let path = entry.with_context(|| folder.display().to_string())?.path();
            match path.metadata() {
                Ok(meant) if meant.is_dir() => folders.push(path),
                Ok(_) => {}
                Err(error) => self.skip(&path, format!("a link that leads nowhere ({error})")),
            }
        }
        folders.sort();
        Ok(folders)
    }

    fn skip(&mut self, path: &Path, reason: String) {
        self.skipped.push(Skipped { file: self.shown(path), reason });
    }

    fn shown(&self, path: &Path) -> String {
        path.strip_prefix(self.source).unwrap_or(path).display().to_string()
    }
}

/// Reads and checks all files, on all cores; `progress` is called with how many are read.
pub(super) fn read(
    files: &[SourceFile],
    progress: &(dyn Fn(u64) + Sync),
) -> (Vec<Recording>, Vec<RecordedStart>, Vec<Skipped>) {
    let done = AtomicU64::new(0);
    let parsed: Vec<Result<Parsed, Skipped>> = files
        .par_iter()
        .map(|file| {
            let parsed = parse(file).map_err(|reason| Skipped { file: file.shown.clone(), reason });
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            parsed
        })
        .collect();
    let (mut recordings, mut settings, mut skipped) = (Vec::new(), Vec::new(), Vec::new());
    for item in parsed {
        match item {
            Ok(Parsed::Recording(recording)) => recordings.push(*recording),
            Ok(Parsed::RecordedStart(setting)) => settings.push(setting),
            Err(skip) => skipped.push(skip),
        }
    }
    (recordings, settings, skipped)
}

fn parse(file: &SourceFile) -> Result<Parsed, String> {
    let text = plain_file::read(&file.path).map_err(|error| error.to_string())?;
    // The test splits publish no plan: further states of their scenes.
    if file.split.starts_with("tests") {
        let data: SceneOnly = read_fields(&text)?;
        return Ok(Parsed::RecordedStart(RecordedStart::new(&data.scene)?));
    }
    parse_recording(&text, &file.id, &file.split).map(|recording| Parsed::Recording(Box::new(recording)))
}

/// Reads JSON that is the whole text; what is wrong begins with the field.
fn read_fields<T: serde::de::DeserializeOwned>(text: &[u8]) -> Result<T, String> {
    let text = text_file::content(text).map_err(|error| error.to_string())?;
    let mut reader = serde_json::Deserializer::from_slice(text);
    let read =
        serde_path_to_error::deserialize(&mut reader).map_err(|error| match error.path().to_string().as_str() {
            "." => error.inner().to_string(),
            field => format!("{field}: {}", error.inner()),
        })?;
    reader.end().map_err(|error| format!("something follows the JSON: {error}"))?;
    Ok(read)
}

/// Reads and checks one `traj_data.json`.
///
/// # Errors
/// What is wrong with it, naming the field.
pub fn parse_recording(text: &[u8], id: &str, split: &str) -> Result<Recording, String> {
    let data: TrajData = read_fields(text)?;
    Recording::new(id.to_owned(), split.to_owned(), data)
}
