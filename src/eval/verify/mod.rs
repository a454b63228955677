//! Verifying a run: its episodes are played again, and must come out the same, step by step.

mod remote;
mod evaluated;
mod sources;
mod step_by_step;
mod verdict;

pub use verdict::Verdict;
pub(crate) use verdict::{Difference, Mismatch};

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;

use crate::data::json;
use crate::env::remote::{RemoteSettings, Sessions};
use crate::episode::record::{Episode, EpisodeKey};
use crate::report::summary::RunSummary;
use crate::run_dir::episode_spec::{EpisodeSpec, episode_specs};
use crate::run_dir::layout::SUMMARY;
use crate::run_dir::reader::RecordedRun;
use sources::{FindPolicy, Sources};
use step_by_step::RecordedEpisode;
use verdict::Agreement;

/// Plays every episode of a run again, those of an evaluation many at once. `progress` hears how many are done.
///
/// # Errors
/// When a task does not fit its scene, the summary is malformed, or a policy cannot be made. What differs is in the verdict.
pub fn verify(
    run: &RecordedRun,
    find: &mut FindPolicy<'_>,
    jobs: usize,
    remote: &RemoteSettings,
    progress: &mut dyn FnMut(usize),
) -> anyhow::Result<Verdict> {
    let mut verdict = Verdict { summarised: summarised(&run.path)?, ..Verdict::default() };
    let mut sources = Sources::new(find);
    let specs: BTreeMap<EpisodeKey, EpisodeSpec> =
        episode_specs(&run.manifest, &run.set.tasks).into_iter().map(|spec| (spec.key(&run.set.tasks), spec)).collect();
    let mut sessions = Sessions::new(remote.clone());
    let mut again = evaluated_again(run, &specs, &mut sources, (jobs, remote), progress)?;
    for (number, episode) in (1..).zip(&run.episodes) {
        let agreement = match again.remove(&episode.key()) {
            Some(agreement) => agreement,
            None if run.task(episode)?.env.is_some() => {
                remote::retrace(run, episode, &mut sessions).with_context(|| format!("episode {number}"))?
            }
            None => {
                let (task_index, task, setting) = run.setting(episode).with_context(|| format!("episode {number}"))?;
                // An explored run has one episode a task and acts in a policy's first slot.
                let index =
                    if episode.is_explored() { 0 } else { specs.get(&episode.key()).map_or(0, |spec| spec.index) };
                let author = run.author(task_index, episode);
                let (grading, end) = (run.manifest.grader, run.manifest.end);
                let recorded = RecordedEpisode { episode, task, setting, author, grading, end, index };
                recorded.retrace(&mut sources).with_context(|| format!("episode {number}"))?
            }
        };
        verdict.steps += agreement.steps;
        verdict.choices += agreement.choices;
        let task = episode.task.clone();
        let difference = agreement.mismatch.map(|mismatch| Difference { episode: number, task, mismatch });
        verdict.differences.extend(difference);
        verdict.episodes += 1;
        verdict.plain += usize::from(episode.is_plain());
        progress(verdict.episodes + again.len());
    }
    verdict.missing = sources.missing;
    Ok(verdict)
}

/// How far the episodes that an evaluation played to their end agree; none where its policy is not at hand.
fn evaluated_again(
    run: &RecordedRun,
    specs: &BTreeMap<EpisodeKey, EpisodeSpec>,
    sources: &mut Sources<'_, '_>,
    (jobs, remote): (usize, &RemoteSettings),
    progress: &mut dyn FnMut(usize),
) -> anyhow::Result<BTreeMap<EpisodeKey, Agreement>> {
    // What an error cut short, a step without an end among them, is not played on.
    let is_whole = |episode: &&Episode| !episode.is_explored() && episode.error.is_none();
    let mut wanted: Vec<EpisodeSpec> =
        run.episodes.iter().filter(is_whole).filter_map(|episode| specs.get(&episode.key()).copied()).collect();
    wanted.sort_by_key(|spec| spec.index);
    let author = run.author(0, &Episode::default());
    match if wanted.is_empty() { None } else { sources.find(&author)? } {
        Some(source) => evaluated::play_again(run, &wanted, &source, jobs, remote, progress),
        None => Ok(BTreeMap::new()),
    }
}

/// How many episodes the summary of a run tells of, where there is one.
fn summarised(run: &Path) -> anyhow::Result<Option<usize>> {
    let path = run.join(SUMMARY);
    let summary = path.exists().then(|| json::read::<RunSummary>(&path, RunSummary::FORMAT)).transpose()?;
    Ok(summary.map(|summary| summary.value.episodes))
}

#[cfg(test)]
mod tests;
