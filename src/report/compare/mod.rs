//! Runs compared with a first one.

pub(crate) mod markdown;
pub(crate) mod paired;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use self::paired::PairedComparison;
use super::estimates::Mean;
use super::stats;
use super::stats::Interval;
use super::summary::RunSummary;
use crate::episode::record::Episode;
use crate::episode::rollout::EndedBy;
use crate::run_dir::reader::RecordedRun;

/// Several runs of the same tasks, each further one compared with the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// Version of the format of a comparison.
    #[schemars(extend("const" = Comparison::FORMAT))]
    pub(crate) format_version: u32,
    /// Each run by itself, in the order given.
    pub(crate) runs: Vec<RunFigures>,
    /// Every further run against the first.
    pub(crate) pairs: Vec<PairedComparison>,
}

/// The figures of one run, from its summary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RunFigures {
    /// The run's folder, or its folders with commas between.
    pub(crate) run: String,
    /// The name of the task set that it played.
    pub(crate) task_set: String,
    /// The name of the policy that acted.
    pub(crate) policy: String,
    /// Whose word ended an episode before its time.
    #[serde(default, skip_serializing_if = "EndedBy::is_grader")]
    pub(crate) end: EndedBy,
    /// Episodes in the tasks' own words from their starts.
    pub(crate) episodes: usize,
    /// Episodes that ended with an error.
    pub(crate) errors: usize,
    /// The share of episodes in which every subtask was completed.
    pub(crate) success: f64,
    /// The 95 % Wilson interval of `success`, lower end first.
    pub(crate) success_interval: Interval,
    /// Completed subtasks of an episode.
    pub(crate) completed_subtasks: Mean,
    /// The same by folder, where there are several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) completed_subtasks_by_folder: Vec<f64>,
    /// Mean of completed subtasks as a share of an episode's subtasks.
    pub(crate) progress: f64,
    /// The same by the number of subtasks.
    pub(crate) progress_by_length: BTreeMap<u32, f64>,
}

impl Comparison {
    /// The format version this program writes.
    pub(crate) const FORMAT: u32 = 4;

    /// Compares every further run with the first; with it comes each run's summary.
    ///
    /// # Errors
    /// When there are fewer than two, or two have no episode in common.
    pub fn of(runs: &[RecordedRun]) -> anyhow::Result<(Comparison, Vec<RunSummary>)> {
        let [first, others @ ..] = runs else { anyhow::bail!("name the runs to compare") };
        anyhow::ensure!(!others.is_empty(), "name a second run to compare with {}", first.path.display());
        let summary = |run: &RecordedRun| {
            let partial = run.episodes.len() < run.episode_specs().len();
            RunSummary::of(&run.manifest, &run.set.tasks, &run.episodes, partial)
        };
        let summaries: Vec<RunSummary> = runs.iter().map(summary).collect();
        let figures = |(run, summary): (&RecordedRun, &RunSummary)| RunFigures {
            run: run.path.display().to_string(),
            task_set: summary.task_set.clone(),
            policy: summary.policy.clone(),
            end: summary.end,
            episodes: summary.episodes,
            errors: summary.errors,
            success: summary.success,
            success_interval: summary.success_interval,
            completed_subtasks: summary.completed_subtasks,
            completed_subtasks_by_folder: completed_by_folder(run),
            progress: summary.progress.mean,
            progress_by_length: summary.progress_by_length.clone(),
        };
        let comparison = Comparison {
            format_version: Comparison::FORMAT,
            runs: runs.iter().zip(&summaries).map(figures).collect(),
            pairs: others.iter().map(|other| PairedComparison::of(first, other)).collect::<anyhow::Result<_>>()?,
        };
        Ok((comparison, summaries))
    }

    /// The most episodes in which a run fell behind the first.
    pub(crate) fn regressions(&self) -> usize {
        self.pairs.iter().map(|pair| pair.regressions.len()).max().unwrap_or(0)
    }
}

/// Completed subtasks in the tasks' own words from their starts, folder by folder where there are several.
fn completed_by_folder(run: &RecordedRun) -> Vec<f64> {
    if run.sources.len() < 2 {
        return Vec::new();
    }
    let mean = |episodes: &[Episode]| {
        let counted = episodes.iter().filter(|episode| episode.is_plain());
        stats::mean(counted.map(|episode| f64::from(episode.completed)))
    };
    run.by_folder().map(|(_, episodes)| mean(episodes)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::compare::paired::tests::run;

    #[test]
    fn three_runs_make_a_table_and_a_chapter_each() {
        let runs = [run("a", &[true, true, false]), run("b", &[true, false, false]), run("c", &[true, true, true])];
        let (comparison, summaries) = Comparison::of(&runs).unwrap();
        assert_eq!((comparison.pairs.len(), summaries.len(), comparison.regressions()), (2, 3, 1));
        let page = comparison.markdown();
        for part in
            ["| against a ", "## b against a", "## c against a", "### Regressions", "### Fixes", "sprint open b#2"]
        {
            assert!(page.contains(part), "{part} in {page}");
        }
        assert!(page.contains("-33.3 pp") && page.contains("bootstrap over tasks"), "{page}");
        assert!(Comparison::of(&runs[..1]).is_err());
    }

    #[test]
    fn a_method_trained_twice_is_one_row_that_tells_both_trainings() {
        let twice = RecordedRun::joined(vec![run("a1", &[true, true]), run("a2", &[true, false])]).unwrap();
        let other = RecordedRun::joined(vec![run("b1", &[false, false]), run("b2", &[true, false])]).unwrap();
        let (comparison, _) = Comparison::of(&[twice, other]).unwrap();
        let [first, second] = &comparison.runs[..] else { panic!("two rows") };
        assert_eq!((first.episodes, &first.completed_subtasks_by_folder), (4, &vec![2.0, 1.5]));
        assert_eq!((second.completed_subtasks.mean, &second.completed_subtasks_by_folder), (1.25, &vec![1.0, 1.5]));
        assert_eq!((comparison.pairs[0].pairs, comparison.regressions()), (4, 2));
        let page = comparison.markdown();
        for part in ["| a1 and 1 more |", "| 2.00 1.50 |", "## b1 and 1 more against a1 and 1 more", "sprint open b1#2"]
        {
            assert!(page.contains(part), "{part} in {page}");
        }
    }
}
