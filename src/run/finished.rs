//! A run folder as it is read afterwards: to compare it, to merge it, to draw it.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use super::booking::{Booking, bookings};
use super::episode::{Episode, Key};
use super::folder::{RunFolder, read_episodes};
use super::manifest::Manifest;
use super::scenes::Scenes;
use crate::data::{json, taskset};
use crate::domain::TaskSet;

/// A run as it lies on the disk.
pub struct FinishedRun {
    /// Its folder.
    pub path: PathBuf,
    /// What it was made from.
    pub manifest: Manifest,
    /// The tasks that it plays.
    pub set: TaskSet,
    /// Where they play.
    pub scenes: Scenes,
    /// Its episodes, in the order of their lines.
    pub episodes: Vec<Episode>,
}

impl FinishedRun {
    /// Reads a run folder.
    ///
    /// # Errors
    /// When it is none, or one of its files is broken; names the file.
    pub fn open(path: &Path) -> anyhow::Result<FinishedRun> {
        let name = path.display();
        ensure!(path.is_dir(), "{name} is not a folder");
        let manifest_path = path.join(RunFolder::MANIFEST);
        ensure!(manifest_path.exists(), "{name} holds no run: there is no {}", RunFolder::MANIFEST);
        let manifest = json::read::<Manifest>(&manifest_path, Manifest::FORMAT)?.value;
        manifest.check().with_context(|| manifest_path.display().to_string())?;
        let tasks = path.join(RunFolder::TASKS);
        let set = taskset::read(&tasks)?.value;
        ensure!(
            set.tasks.len() == manifest.tasks,
            "{}: {} tasks, but the run's manifest says {}",
            tasks.display(),
            set.tasks.len(),
            manifest.tasks
        );
        let (episodes, _) = read_episodes(&path.join(RunFolder::EPISODES))?;
        let known: std::collections::BTreeSet<&str> = set.tasks.iter().map(|task| task.id.as_str()).collect();
        if let Some(stranger) = episodes.iter().find(|episode| !known.contains(episode.task.as_str())) {
            anyhow::bail!("{}: the run has no task {:?}", path.join(RunFolder::EPISODES).display(), stranger.task);
        }
        let scenes = Scenes::of(&tasks, &set);
        Ok(FinishedRun { path: path.to_owned(), manifest, set, scenes, episodes })
    }

    /// What it is called in tables: its folder's name.
    pub fn name(&self) -> String {
        let last = self.path.file_name().or_else(|| self.path.parent().and_then(Path::file_name));
        last.map_or_else(|| self.path.display().to_string(), |name| name.to_string_lossy().into_owned())
    }

    /// Every episode that the run, or its share, comes to.
    pub fn bookings(&self) -> Vec<Booking> {
        let all = bookings(&self.manifest, &self.set.tasks);
        let own = self.manifest.shard.map_or(0..all.len(), |shard| shard.range(all.len()));
        all[own].to_vec()
    }

    /// How the explorer is told to open an episode: by the number of its line in the run's order, from 1.
    ///
    /// # Errors
    /// When the run has no such episode.
    pub fn reference(&self, key: &Key) -> anyhow::Result<String> {
        let place = self.episodes.iter().position(|episode| episode.key() == *key);
        let place = place.with_context(|| format!("{}: no episode of {key}", self.path.display()))?;
        Ok(format!("{}#{}", self.path.display(), place + 1))
    }
}
