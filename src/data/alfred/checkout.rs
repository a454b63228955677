//! An ALFRED checkout: its files are found, read and checked.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, bail};
use rayon::prelude::*;

use super::files::{SceneOnly, TrajData};
use super::recording::{RecordedStart, Recording};
use crate::data::dataset::Skipped;

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

/// Every `traj_data.json` of the checkout.
pub(super) fn find(source: &Path) -> anyhow::Result<Vec<SourceFile>> {
    let folders = ["data/json_2.1.0", "data/full_2.1.0", "data/json_feat_2.1.0"];
    let Some(data) = folders.iter().map(|folder| source.join(folder)).find(|folder| folder.is_dir()) else {
        bail!(
            "{} is no ALFRED checkout: it has no folder data/json_2.1.0 (see the dataset's download script)",
            source.display()
        );
    };
    let mut files = Vec::new();
    for split in folders_in(&data)? {
        let name = split.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let mut open = vec![(split.clone(), 0)];
        while let Some((folder, depth)) = open.pop() {
            let path = folder.join("traj_data.json");
            if path.is_file() {
                let shown = path.strip_prefix(source).unwrap_or(&path).display().to_string();
                let id = folder.strip_prefix(&split).unwrap_or(&folder).to_string_lossy().replace('\\', "/");
                files.push(SourceFile { path, shown, split: name.clone(), id });
            } else if depth < 3 {
                open.extend(folders_in(&folder)?.into_iter().map(|inner| (inner, depth + 1)));
            }
        }
    }
    if files.is_empty() {
        bail!("{} holds no traj_data.json", data.display());
    }
    files.sort_by(|a, b| a.shown.cmp(&b.shown));
    Ok(files)
}

fn folders_in(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut folders = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if path.is_dir() {
            folders.push(path);
        }
    }
    folders.sort();
    Ok(folders)
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
    let text = std::fs::read(&file.path).map_err(|error| error.to_string())?;
    // The test splits publish no plan: further states of their scenes.
    if file.split.starts_with("tests") {
        let data: SceneOnly = read_fields(&text)?;
        return Ok(Parsed::RecordedStart(RecordedStart::new(&data.scene)?));
    }
    parse_recording(&text, &file.id, &file.split).map(|recording| Parsed::Recording(Box::new(recording)))
}

/// Reads JSON; what is wrong begins with the field.
fn read_fields<T: serde::de::DeserializeOwned>(text: &[u8]) -> Result<T, String> {
    let mut reader = serde_json::Deserializer::from_slice(text);
    serde_path_to_error::deserialize(&mut reader).map_err(|error| match error.path().to_string().as_str() {
        "." => error.inner().to_string(),
        field => format!("{field}: {}", error.inner()),
    })
}

/// Reads and checks one `traj_data.json`.
///
/// # Errors
/// What is wrong with it, naming the field.
pub fn parse_recording(text: &[u8], id: &str, split: &str) -> Result<Recording, String> {
    let data: TrajData = read_fields(text)?;
    Recording::new(id.to_owned(), split.to_owned(), data)
}
