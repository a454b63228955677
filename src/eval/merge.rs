//! Joins the shares of a run into the same folder that one machine would have written.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

use super::evaluation::finish;
use super::tasks::scene_folder;
use crate::episode::record::EpisodeKey;
use crate::language::count::counted;
use crate::report::summary::RunSummary;
use crate::run_dir::episode_spec::episode_specs;
use crate::run_dir::layout::TASKS;
use crate::run_dir::manifest::RunManifest;
use crate::run_dir::policy_places;
use crate::run_dir::reader::RecordedRun;
use crate::run_dir::shard::Shard;
use crate::run_dir::writer::RunWriter;

/// The shares that lie in a run's folder, by number.
///
/// # Errors
/// When there are none, or the folder cannot be read.
pub(crate) fn shares_in(run: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let folder = run.join(Shard::FOLDER);
    let none = || format!("{} holds no shares; eval --shard writes them", folder.display());
    if !folder.exists() {
        bail!(none());
    }
    let entries = std::fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut found: Vec<PathBuf> =
        entries.filter_map(Result::ok).map(|entry| entry.path()).filter(|path| path.is_dir()).collect();
    found.sort();
    ensure!(!found.is_empty(), none());
    Ok(found)
}

/// Merges shares into the run folder `into`.
///
/// # Errors
/// When a share is missing, there twice, not of the same run, or not complete; or when the folder holds another run.
pub(crate) fn merge(shares: &[PathBuf], into: &Path) -> anyhow::Result<RunSummary> {
    let mut runs = BTreeMap::new();
    for path in shares {
        let run = RecordedRun::open_evaluated(path)?;
        let shard = run.manifest.shard.with_context(|| format!("{} is no share but a whole run", path.display()))?;
        if let Some(other) = runs.insert(shard.index, run) {
            bail!("{} and {} are the same share {shard}", other.path.display(), path.display());
        }
    }
    let (_, first) = runs.first_key_value().context("there are no shares to merge")?;
    let manifest = RunManifest { shard: None, ..first.manifest.clone() };
    let of = first.manifest.shard.map_or(1, |shard| shard.of);
    for run in runs.values() {
        let whole = RunManifest { shard: None, ..run.manifest.clone() };
        let differences = manifest.differences(&whole);
        if !differences.is_empty() {
            bail!(
                "{} and {} are not of one run ({})",
                first.path.display(),
                run.path.display(),
                differences.join("; ")
            );
        }
        let others = run.manifest.shard.map_or(1, |shard| shard.of);
        ensure!(
            others == of,
            "{}: a share of {others}, but {} is one of {of}",
            run.path.display(),
            first.path.display()
        );
    }
    let missing: Vec<String> =
        (1..=of).filter(|index| !runs.contains_key(index)).map(|i| format!("{i}/{of}")).collect();
    ensure!(missing.is_empty(), "missing shares: {}; play them with eval --shard", missing.join(", "));
    let file = first.path.join(TASKS);
    let (set, episodes) = (first.set.clone(), runs.values().map(|run| run.episodes.len()).sum::<usize>());
    let all = episode_specs(&manifest, &set.tasks);
    for run in runs.values() {
        let (found, wanted) = (run.episodes.len(), run.episode_specs().len());
        ensure!(
            found == wanted,
            "{} has {found} of its {}; the same eval command with --shard completes it",
            run.path.display(),
            counted(wanted, "episode")
        );
    }
    ensure!(episodes == all.len(), "the shares hold {}, the run has {}", counted(episodes, "episode"), all.len());
    let mut folder = RunWriter::open(into, &manifest)?;
    policy_places::write(into, &first.places)?;
    folder.write_tasks(&scene_folder::as_seen_from(&set, &set.tasks, &file, into)?)?;
    let there: std::collections::BTreeSet<EpisodeKey> =
        folder.earlier.iter().map(crate::episode::record::Episode::key).collect();
    for run in runs.values() {
        let mut by_key: BTreeMap<EpisodeKey, _> = run.episodes.iter().map(|episode| (episode.key(), episode)).collect();
        for spec in run.episode_specs() {
            let key = spec.key(&set.tasks);
            let episode =
                by_key.remove(&key).with_context(|| format!("{}: no episode of {key}", run.path.display()))?;
            if !there.contains(&key) {
                folder.append(episode)?;
            }
        }
    }
    finish(&manifest, &set.tasks, &all, &mut folder)
}
