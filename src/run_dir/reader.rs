//! A run folder read back: to compare it, to merge it, to draw it, to verify it, to open its episodes.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use super::episode_spec::{EpisodeSpec, own_specs, policy_seed};
use super::episodes::read_episodes;
use super::layout::{EPISODES, MANIFEST, TASKS};
use super::manifest::RunManifest;
use super::policy_places;
use super::record_check::RecordCheck;
use crate::agent::policy_place::PolicyPlace;
use crate::data::json::Document;
use crate::data::{json, taskset};
use crate::domain::{Task, TaskSet};
use crate::episode::record::{Author, Episode, EpisodeKey};
use crate::episode::scenes::{Scenes, Setting};
use crate::language::count::counted;

/// A run as it lies on the disk.
pub struct RecordedRun {
    /// Its folder; of [joined](RecordedRun::joined) runs their folders with commas between.
    pub(crate) path: PathBuf,
    /// The folders that its episodes lie in, with the number of them in each, in the order of the episodes.
    pub(crate) sources: Vec<(PathBuf, usize)>,
    /// What it was made from.
    pub manifest: RunManifest,
    /// Where its policies were that are none of the program's own.
    pub(crate) places: Vec<PolicyPlace>,
    /// The tasks that it plays.
    pub(crate) set: TaskSet,
    /// The scenes that its tasks play in.
    pub(crate) scenes: Scenes,
    /// Its episodes, in the order of their lines.
    pub(crate) episodes: Vec<Episode>,
}

impl RecordedRun {
    /// Reads a run folder, a person's exploration or an evaluation. Its tasks are in it, or in `tasks`, the file that the run
    /// was made from.
    ///
    /// # Errors
    /// When it is none, one of its files is broken, its tasks are not at hand, or `tasks` is another file; names the file.
    pub fn open(path: &Path, tasks: Option<&Path>) -> anyhow::Result<RecordedRun> {
        let name = path.display();
        ensure!(path.is_dir(), "{name} is not a folder");
        let manifest_path = path.join(MANIFEST);
        ensure!(manifest_path.exists(), "{name} holds no run: there is no {MANIFEST}");
        let manifest = RunManifest::read(&manifest_path)?;
        manifest.check().with_context(|| manifest_path.display().to_string())?;
        let (set, scenes) = tasks_of(path, &manifest, tasks)?;
        let (episodes, _) = read_episodes(&path.join(EPISODES))?;
        let belonging = RecordCheck::new(&manifest, &set.tasks);
        if let Some(misfit) = episodes.iter().find_map(|episode| belonging.check(episode).err()) {
            anyhow::bail!("{}: {misfit}", path.join(EPISODES).display());
        }
        let sources = vec![(path.to_owned(), episodes.len())];
        let places = policy_places::read(path)?;
        Ok(RecordedRun { path: path.to_owned(), sources, manifest, places, set, scenes, episodes })
    }

    /// Reads the run folder of an evaluation: its tasks are in it, and each can be graded.
    ///
    /// # Errors
    /// As [`open`](RecordedRun::open), and when a task is not complete.
    pub fn open_evaluated(path: &Path) -> anyhow::Result<RecordedRun> {
        let run = RecordedRun::open(path, None)?;
        taskset::check(&run.set).with_context(|| path.join(TASKS).display().to_string())?;
        Ok(run)
    }

    /// Takes runs of the same tasks by agents that differ in their training's seed for one: the episodes' seeds of each go on
    /// after those of the one before.
    ///
    /// # Errors
    /// When there is none, or they differ in more than the checkpoint and its name; says in what.
    pub(crate) fn joined(runs: Vec<RecordedRun>) -> anyhow::Result<RecordedRun> {
        let mut runs = runs.into_iter();
        let mut all = runs.next().context("name the runs to join")?;
        let (seeds, own) = (all.manifest.seeds, all.manifest.clone());
        for run in runs {
            let RunManifest { policy, checkpoint_hash, .. } = own.clone();
            let differences = own.differences(&RunManifest { policy, checkpoint_hash, ..run.manifest.clone() });
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
            all.places.extend(run.places);
            all.manifest.seeds += seeds;
            all.manifest.checkpoint_hash = None;
        }
        all.manifest.check()?;
        Ok(all)
    }

    /// The task of an episode.
    ///
    /// # Errors
    /// When the set has no such task.
    pub(crate) fn task(&self, episode: &Episode) -> anyhow::Result<&Task> {
        let found = self.set.tasks.iter().find(|task| task.id == episode.task);
        found.with_context(|| format!("the tasks hold no {:?}", episode.task))
    }

    /// The task of an episode, with its position in the set, and where it starts.
    ///
    /// # Errors
    /// When the set has no such task, or it fits its scene no longer.
    pub(crate) fn setting(&self, episode: &Episode) -> anyhow::Result<(usize, &Task, Setting)> {
        let found = self.set.tasks.iter().enumerate().find(|(_, task)| task.id == episode.task);
        let (index, task) = found.with_context(|| format!("the tasks hold no {:?}", episode.task))?;
        Ok((index, task, self.scenes.setting(task)?))
    }

    /// Who acted in an episode that does not say so.
    pub(crate) fn author(&self, task: usize, episode: &Episode) -> Author {
        Author {
            policy: self.manifest.policy.clone(),
            checkpoint: self.manifest.checkpoint_hash.clone(),
            seed: policy_seed(task, episode.seed),
            sampling: self.manifest.sampling,
            deciding: self.manifest.deciding,
        }
    }

    /// Every episode that the run, or its share, comes to.
    pub fn episode_specs(&self) -> Vec<EpisodeSpec> {
        own_specs(&self.manifest, &self.set.tasks)
    }

    /// How the explorer is told to open an episode: by the number of its line in the run's order, from 1.
    ///
    /// # Errors
    /// When the run has no such episode.
    pub(crate) fn reference(&self, key: &EpisodeKey) -> anyhow::Result<String> {
        let place = |episodes: &[Episode]| episodes.iter().position(|episode| episode.key() == *key);
        let found = self.by_folder().find_map(|(folder, episodes)| Some((folder, place(episodes)?)));
        let (folder, place) = found.with_context(|| format!("{}: no episode of {key}", self.path.display()))?;
        Ok(format!("{}#{}", folder.display(), place + 1))
    }

    /// Its folders, each with the episodes that lie in it.
    pub(crate) fn by_folder(&self) -> impl Iterator<Item = (&Path, &[Episode])> {
        let mut rest = self.episodes.as_slice();
        self.sources.iter().map(move |(folder, count)| {
            let (own, others) = rest.split_at(*count);
            rest = others;
            (folder.as_path(), own)
        })
    }
}

/// The tasks of a run: those in its folder, which are what it played of the file that it was made from, or of that file.
fn tasks_of(run: &Path, manifest: &RunManifest, file: Option<&Path>) -> anyhow::Result<(TaskSet, Scenes)> {
    let own = run.join(TASKS);
    ensure!(
        file.is_some() || own.exists(),
        "{} does not hold its tasks; name the file that it was made from with --tasks (the set {:?})",
        run.display(),
        manifest.task_set
    );
    let path = file.unwrap_or(&own);
    let Document { value, digest } = json::read::<TaskSet>(path, TaskSet::FORMAT)?;
    let mut set = value.filled();
    if file.is_some() {
        ensure!(
            digest == manifest.task_set_hash,
            "{} is not what {} was made from: its SHA-256 is {digest:.12}, the run's {:.12}",
            path.display(),
            run.display(),
            manifest.task_set_hash
        );
        set.tasks.truncate(manifest.tasks);
    }
    ensure!(
        set.tasks.len() == manifest.tasks,
        "{}: {}, but the run's manifest says {}",
        path.display(),
        counted(set.tasks.len(), "task"),
        manifest.tasks
    );
    let scenes = Scenes::of(path, &set);
    Ok((set, scenes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::compare::paired::tests::run;

    #[test]
    fn joined_runs_are_one_with_more_seeds_and_each_episode_keeps_its_folder() {
        let [mut a, mut b] = [run("a", &[true, false]), run("b", &[false, true])];
        (a.manifest.checkpoint_hash, b.manifest.checkpoint_hash) = (Some("aa".into()), Some("bb".into()));
        let joined = RecordedRun::joined(vec![a, b]).unwrap();
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
        let error = RecordedRun::joined(vec![run("a", &[true]), other]).err().unwrap().to_string();
        assert!(error.contains("a and b") && error.contains("step_by_step: false, not true"), "{error}");
    }
}
