//! Writing a run folder: a manifest, then an episode a line as they come.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use sha2::{Digest, Sha256};

use super::episodes::read_episodes;
use super::layout::{EPISODES, MANIFEST, TASKS};
use super::manifest::RunManifest;
use super::shard::Shard;
use crate::data::locked_file::LockedFile;
use crate::data::{atomic_file, folder, json, plain_file};
use crate::domain::TaskSet;
use crate::episode::record::{Episode, EpisodeKey};

/// An open run folder, which no other process writes to.
pub struct RunWriter {
    path: PathBuf,
    episodes: LockedFile,
    /// The episodes that were there when it was opened, without their traces.
    pub(crate) earlier: Vec<Episode>,
}

impl RunWriter {
    /// Opens a folder for this run: a new or empty one, or one that the same run began, which is then continued.
    ///
    /// # Errors
    /// When it holds something else (naming what differs), is being written to by another process, or cannot be written to.
    pub fn open(path: &Path, manifest: &RunManifest) -> anyhow::Result<RunWriter> {
        let name = path.display();
        folder::make(path).with_context(|| format!("cannot make the run folder {name}"))?;
        own_files_only(path)?;
        let manifest_path = path.join(MANIFEST);
        if !manifest_path.exists() {
            only_begun(path)?;
        }
        let episodes_path = path.join(EPISODES);
        let context = || format!("cannot write {}", episodes_path.display());
        let episodes = plain_file::append(&episodes_path).with_context(context)?;
        let episodes = LockedFile::lock_where_possible(episodes)
            .with_context(|| format!("{name}: another process is writing this run; wait for it to end"))?;
        if manifest_path.exists() {
            let found = RunManifest::read(&manifest_path)?;
            let differences = found.differences(manifest);
            if !differences.is_empty() {
                bail!("{name} holds another run ({}); choose another folder with --out", differences.join("; "));
            }
        } else {
            json::write_pretty(&manifest_path, manifest)?;
        }
        let (mut earlier, whole) = read_episodes(&episodes_path)?;
        for episode in &mut earlier {
            episode.trace = Vec::new();
        }
        // What follows the last whole line is the rest of a write that was cut off.
        episodes.set_len(whole).with_context(context)?;
        atomic_file::remove_unfinished(path);
        Ok(RunWriter { path: path.to_owned(), episodes, earlier })
    }

    /// The run's folder.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends an episode, as one write of one line.
    ///
    /// # Errors
    /// When the disk is full or the folder went away.
    pub(crate) fn append(&mut self, episode: &Episode) -> anyhow::Result<()> {
        let context = || format!("cannot write {}", self.path.join(EPISODES).display());
        let mut line = serde_json::to_vec(episode).with_context(context)?;
        line.push(b'\n');
        self.episodes.write_all(&line).with_context(context)
    }

    /// Writes down which tasks are played, so that the folder can be opened without their file.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub fn write_tasks(&self, set: &TaskSet) -> anyhow::Result<()> {
        // The manifest vouches for the set; a file that was changed since would show other tasks.
        json::write(&self.path.join(TASKS), set)
    }

    /// The episodes in the given order, without their traces, and the SHA-256 of their lines in that order: that of the file
    /// `episodes.jsonl` of a run that nothing went wrong in.
    ///
    /// # Errors
    /// When the file cannot be read any more.
    pub(crate) fn result(&self, order: &[EpisodeKey]) -> anyhow::Result<(Vec<Episode>, String)> {
        let (episodes, _) = read_episodes(&self.path.join(EPISODES))?;
        let mut by_key: BTreeMap<EpisodeKey, Episode> = episodes.into_iter().map(|e| (e.key(), e)).collect();
        let mut digest = Sha256::new();
        let mut ordered = Vec::new();
        for key in order {
            let Some(mut episode) = by_key.remove(key) else { continue };
            digest.update(serde_json::to_vec(&episode)?);
            digest.update(b"\n");
            episode.trace = Vec::new();
            ordered.push(episode);
        }
        Ok((ordered, json::hex(&digest.finalize())))
    }
}

/// No file of the folder lies elsewhere: what is written stays in it.
fn own_files_only(path: &Path) -> anyhow::Result<()> {
    let entries = std::fs::read_dir(path).with_context(|| format!("cannot read {}", path.display()))?;
    for entry in entries {
        let entry = entry.with_context(|| format!("cannot read {}", path.display()))?;
        if entry.file_type().is_ok_and(|kind| kind.is_symlink()) {
            bail!("{}: a symbolic link; a run folder holds its own files, so remove it", entry.path().display());
        }
    }
    Ok(())
}

/// A folder without a manifest holds nothing, or what a run left that was killed before it had written one.
fn only_begun(path: &Path) -> anyhow::Result<()> {
    let name = path.display();
    for entry in std::fs::read_dir(path).with_context(|| format!("cannot read {name}"))? {
        let entry = entry.with_context(|| format!("cannot read {name}"))?;
        let file = entry.file_name();
        let file = file.to_string_lossy();
        let empty = || entry.metadata().is_ok_and(|metadata| metadata.is_file() && metadata.len() == 0);
        // The shares of a run lie in the folder that they are merged into.
        let begun = file.starts_with(atomic_file::UNFINISHED) || file == Shard::FOLDER || (file == EPISODES && empty());
        if !begun {
            bail!("{name} is not empty and holds no run; choose another folder with --out");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_dir::episodes::tests::episode;
    use crate::run_dir::manifest::tests::manifest;

    #[test]
    fn the_same_run_is_continued_after_a_torn_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        RunWriter::open(&path, &manifest()).unwrap().append(&episode("a")).unwrap();
        let mut file = std::fs::OpenOptions::new().append(true).open(path.join("episodes.jsonl")).unwrap();
        file.write_all(b"{\"task\":\"b\",\"se").unwrap();
        let mut again = RunWriter::open(&path, &manifest()).unwrap();
        assert_eq!(again.earlier, [episode("a")]);
        again.append(&episode("b")).unwrap();
        let (episodes, _) = read_episodes(&path.join("episodes.jsonl")).unwrap();
        assert_eq!(episodes, [episode("a"), episode("b")]);
    }

    #[test]
    fn a_folder_of_another_run_is_refused_and_the_difference_named() {
        let folder = tempfile::tempdir().unwrap();
        RunWriter::open(folder.path(), &manifest()).unwrap();
        let other = RunManifest { seeds: 3, policy: "expert".into(), ..manifest() };
        let error = RunWriter::open(folder.path(), &other).err().unwrap().to_string();
        assert!(error.contains("seeds: 1, not 3") && error.contains("policy: \"random\", not \"expert\""), "{error}");
        assert!(!error.contains("grader"));
    }

    #[test]
    fn a_folder_of_something_else_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("thesis.tex"), "x").unwrap();
        let error = RunWriter::open(folder.path(), &manifest()).err().unwrap().to_string();
        assert!(error.contains("not empty"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn two_writers_of_one_run_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let _first = RunWriter::open(folder.path(), &manifest()).unwrap();
        let error = RunWriter::open(folder.path(), &manifest()).err().unwrap().to_string();
        assert!(error.contains("another process"), "{error}");
    }
}
