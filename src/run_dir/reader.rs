//! A run folder as it is read afterwards: to compare it, to merge it, to draw it.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use super::episode_spec::{EpisodeSpec, episode_specs};
use super::manifest::Manifest;
use super::writer::{RunFolder, read_episodes};
use crate::data::{json, taskset};
use crate::domain::TaskSet;
use crate::episode::record::{Episode, Key};
use crate::episode::scenes::Scenes;

/// A run as it lies on the disk.
pub struct FinishedRun {
    /// Its folder; of [joined](FinishedRun::joined) runs their folders with commas between.
    pub path: PathBuf,
    /// The folders that its episodes lie in, with the number of them in each, in the order of the episodes.
    pub sources: Vec<(PathBuf, usize)>,
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
        let sources = vec![(path.to_owned(), episodes.len())];
        Ok(FinishedRun { path: path.to_owned(), sources, manifest, set, scenes, episodes })
    }

    /// Takes runs of the same tasks by agents that differ in their training's seed for one: the episodes' seeds of each go on
    /// after those of the one before.
    ///
    /// # Errors
    /// When there is none, or they differ in more than the checkpoint and its name; says in what.
    pub fn joined(runs: Vec<FinishedRun>) -> anyhow::Result<FinishedRun> {
        let mut runs = runs.into_iter();
        let mut all = runs.next().context("name the runs to join")?;
        let (seeds, own) = (all.manifest.seeds, all.manifest.clone());
        for run in runs {
            let Manifest { policy, checkpoint_hash, .. } = own.clone();
            let differences = own.differences(&Manifest { policy, checkpoint_hash, ..run.manifest.clone() });
            let names = format!("{} and {}", all.path.display(), run.path.display());
            ensure!(differences.is_empty(), "{names} cannot be taken for one: {}", differences.join("; "));
            ensure!(own.shard.is_none(), "{names} are shares of runs; `sprint merge` makes whole ones of them");
            if run.manifest.policy != own.policy {
                all.manifest.policy = format!("{},{}", all.manifest.policy, run.manifest.policy);
            }
            let later = |episode: Episode| Episode { seed: episode.seed + all.manifest.seeds, ..episode };
            all.episodes.extend(run.episodes.into_iter().map(later));
            all.path = format!("{},{}", all.path.display(), run.path.display()).into();
            all.sources.extend(run.sources);
            all.manifest.seeds += seeds;
            all.manifest.checkpoint_hash = None;
        }
        all.manifest.check()?;
        Ok(all)
    }

    /// What it is called in tables: its folder's name.
    pub fn name(&self) -> String {
        let last = self.path.file_name().or_else(|| self.path.parent().and_then(Path::file_name));
        last.map_or_else(|| self.path.display().to_string(), |name| name.to_string_lossy().into_owned())
    }

    /// Every episode that the run, or its share, comes to.
    pub fn episode_specs(&self) -> Vec<EpisodeSpec> {
        let all = episode_specs(&self.manifest, &self.set.tasks);
        let own = self.manifest.shard.map_or(0..all.len(), |shard| shard.range(all.len()));
        all[own].to_vec()
    }

    /// How the explorer is told to open an episode: by the number of its line in the run's order, from 1.
    ///
    /// # Errors
    /// When the run has no such episode.
    pub fn reference(&self, key: &Key) -> anyhow::Result<String> {
        let place = |episodes: &[Episode]| episodes.iter().position(|episode| episode.key() == *key);
        let found = self.by_folder().find_map(|(folder, episodes)| Some((folder, place(episodes)?)));
        let (folder, place) = found.with_context(|| format!("{}: no episode of {key}", self.path.display()))?;
        Ok(format!("{}#{}", folder.display(), place + 1))
    }

    /// Its folders, each with the episodes that lie in it.
    pub fn by_folder(&self) -> impl Iterator<Item = (&Path, &[Episode])> {
        let mut rest = self.episodes.as_slice();
        self.sources.iter().map(move |(folder, count)| {
            let (own, others) = rest.split_at(*count);
            rest = others;
            (folder.as_path(), own)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::compare::paired::tests::run;

    #[test]
    fn joined_runs_are_one_with_more_seeds_and_each_episode_keeps_its_folder() {
        let [mut a, mut b] = [run("a", &[true, false]), run("b", &[false, true])];
        (a.manifest.checkpoint_hash, b.manifest.checkpoint_hash) = (Some("aa".into()), Some("bb".into()));
        let joined = FinishedRun::joined(vec![a, b]).unwrap();
        assert_eq!((joined.manifest.seeds, &joined.manifest.checkpoint_hash), (4, &None));
        assert_eq!(joined.path, Path::new("a,b"));
        assert_eq!(joined.episodes.iter().map(|episode| episode.seed).collect::<Vec<_>>(), [0, 1, 2, 3]);
        let opened: Vec<String> =
            joined.episodes.iter().map(|episode| joined.reference(&episode.key()).unwrap()).collect();
        assert_eq!(opened, ["a#1", "a#2", "b#1", "b#2"]);
    }

    #[test]
    fn runs_that_measured_something_else_are_not_joined() {
        let mut other = run("b", &[true]);
        other.manifest.step_by_step = true;
        let error = FinishedRun::joined(vec![run("a", &[true]), other]).err().unwrap().to_string();
        assert!(error.contains("a and b") && error.contains("step_by_step: false, not true"), "{error}");
    }
}
