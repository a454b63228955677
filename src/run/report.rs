//! What a run came to: rates and means with their intervals.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::episode::Episode;
use super::folder::Manifest;
use super::stats::{self, Interval};
use crate::domain::{SkillKind, Task};
use crate::house::grading::Grading;

/// Drives the resampling of the bootstrap.
const BOOTSTRAP_SEED: u64 = 0;

/// A mean and its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mean {
    /// Over all episodes.
    pub mean: f64,
    /// Lower and upper end.
    pub interval: Interval,
}

impl Mean {
    fn of(groups: &[Vec<f64>]) -> Mean {
        let mean = stats::mean(groups.iter().flatten().copied());
        Mean { mean, interval: stats::bootstrap_mean(groups, BOOTSTRAP_SEED) }
    }
}

/// How often the skills of one kind, once reached, were completed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkillRate {
    /// Subtasks of the kind whose turn came.
    pub reached: usize,
    /// Of those, completed.
    pub completed: usize,
    /// The share; 0 when none was reached.
    pub rate: f64,
    /// Its 95 % interval.
    pub interval: Interval,
}

/// How the intervals were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntervalMethods {
    /// Of rates.
    pub rates: String,
    /// Of means.
    pub means: String,
}

/// The summary of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// Version of this format.
    pub format_version: u32,
    /// The task set's name.
    pub task_set: String,
    /// The policy's name.
    pub policy: String,
    /// How subtasks were graded.
    pub grader: Grading,
    /// The run was interrupted; only some of its episodes are in.
    pub partial: bool,
    /// Tasks with at least one episode.
    pub tasks: usize,
    /// Episodes, failed and errored ones included.
    pub episodes: usize,
    /// Episodes that ended with an error; they count as they stood.
    pub errors: usize,
    /// The share of episodes in which every subtask was completed.
    pub success: f64,
    /// Its 95 % interval.
    pub success_interval: Interval,
    /// Completed subtasks of an episode.
    pub completed_subtasks: Mean,
    /// Completed subtasks of an episode as a share of its subtasks.
    pub progress: Mean,
    /// By the number of subtasks: mean completed ones as a share of them.
    pub progress_by_length: BTreeMap<u32, f64>,
    /// By the number of subtasks: the share of successes.
    pub success_by_length: BTreeMap<u32, f64>,
    /// By the number of subtasks: the episodes.
    pub episodes_by_length: BTreeMap<u32, usize>,
    /// By the kind of skill.
    pub skills: BTreeMap<SkillKind, SkillRate>,
    /// Steps of an episode.
    pub steps_mean: f64,
    /// Steps that the expert takes, for the same episodes.
    pub expert_steps_mean: f64,
    /// How the intervals were made.
    pub interval_methods: IntervalMethods,
}

impl Summary {
    /// The format version this program reads and writes.
    pub const FORMAT: u32 = 1;

    /// Sums up `episodes`, each of one of `tasks`; the order of the episodes does not matter.
    pub fn of(manifest: &Manifest, tasks: &[Task], episodes: &[Episode], partial: bool) -> Summary {
        let mut of_task: BTreeMap<&str, Vec<&Episode>> = BTreeMap::new();
        for episode in episodes {
            of_task.entry(&episode.task).or_default().push(episode);
        }
        // By task in the set's order, by seed within: sums of floats then do not depend on the order of the episodes.
        let mut groups: Vec<(&Task, Vec<&Episode>)> =
            tasks.iter().filter_map(|task| Some((task, of_task.remove(task.id.as_str())?))).collect();
        for (_, group) in &mut groups {
            group.sort_by_key(|episode| episode.seed);
        }
        let values = |value: fn(&Episode) -> f64| -> Vec<Vec<f64>> {
            groups.iter().map(|(_, group)| group.iter().map(|episode| value(episode)).collect()).collect()
        };
        let all: Vec<(&Task, &Episode)> =
            groups.iter().flat_map(|(task, group)| group.iter().map(|&episode| (*task, episode))).collect();
        let successes = all.iter().filter(|(_, episode)| episode.success).count();
        let lengths: std::collections::BTreeSet<u32> = all.iter().map(|(_, episode)| episode.of).collect();
        let by_length = |value: fn(&Episode) -> f64| -> BTreeMap<u32, f64> {
            let of_length = |length| all.iter().filter(move |(_, e)| e.of == length).map(move |(_, e)| value(e));
            lengths.iter().map(|&length| (length, stats::mean(of_length(length)))).collect()
        };
        let count = |length| all.iter().filter(|(_, episode)| episode.of == length).count();
        Summary {
            format_version: Summary::FORMAT,
            task_set: manifest.task_set.clone(),
            policy: manifest.policy.clone(),
            grader: manifest.grader,
            partial,
            tasks: groups.len(),
            episodes: all.len(),
            errors: all.iter().filter(|(_, episode)| episode.error.is_some()).count(),
            success: stats::mean(all.iter().map(|(_, episode)| f64::from(u8::from(episode.success)))),
            success_interval: stats::wilson(successes, all.len()),
            completed_subtasks: Mean::of(&values(|episode| f64::from(episode.completed))),
            progress: Mean::of(&values(progress)),
            progress_by_length: by_length(progress),
            success_by_length: by_length(|episode| f64::from(u8::from(episode.success))),
            episodes_by_length: lengths.iter().map(|&length| (length, count(length))).collect(),
            skills: skill_rates(&all),
            steps_mean: stats::mean(all.iter().map(|(_, episode)| f64::from(episode.steps))),
            expert_steps_mean: stats::mean(all.iter().map(|(task, _)| f64::from(task.expert_steps))),
            interval_methods: IntervalMethods {
                rates: "Wilson score, 95 %".into(),
                means: format!(
                    "percentile bootstrap over tasks, 95 %, {} resamples, seed {BOOTSTRAP_SEED}",
                    stats::RESAMPLES
                ),
            },
        }
    }
}

fn progress(episode: &Episode) -> f64 {
    f64::from(episode.completed) / f64::from(episode.of.max(1))
}

fn skill_rates(episodes: &[(&Task, &Episode)]) -> BTreeMap<SkillKind, SkillRate> {
    let mut rates: BTreeMap<SkillKind, SkillRate> = BTreeMap::new();
    for (task, episode) in episodes {
        let completed = episode.completed as usize;
        for (i, subtask) in task.subtasks.iter().enumerate().take(completed + 1) {
            let rate = rates.entry(subtask.skill).or_default();
            rate.reached += 1;
            rate.completed += usize::from(i < completed);
        }
    }
    for rate in rates.values_mut() {
        rate.rate = rate.completed as f64 / rate.reached as f64;
        rate.interval = stats::wilson(rate.completed, rate.reached);
    }
    rates
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;
    use crate::run::folder::tests::{episode, manifest};

    pub(crate) fn sample() -> (Vec<Task>, Vec<Episode>) {
        let tasks = sample_set().tasks;
        let done = |task: &str, seed, completed| Episode {
            seed,
            completed,
            success: completed == 2,
            steps: 10 * (1 + completed),
            ..episode(task)
        };
        let mut episodes = vec![done("first", 0, 2), done("first", 1, 1), done("second", 0, 2), done("second", 1, 0)];
        episodes[3].error = Some("the expert sees no way".into());
        (tasks, episodes)
    }

    #[test]
    fn a_summary_counts_by_hand() {
        let (tasks, episodes) = sample();
        let summary = Summary::of(&manifest(), &tasks, &episodes, false);
        assert_eq!((summary.tasks, summary.episodes, summary.errors), (2, 4, 1));
        assert_eq!(summary.success, 0.5);
        assert_eq!(summary.completed_subtasks.mean, 1.25);
        assert_eq!(summary.progress.mean, 0.625);
        assert_eq!(summary.progress_by_length, BTreeMap::from([(2, 0.625)]));
        assert_eq!(summary.success_by_length, BTreeMap::from([(2, 0.5)]));
        assert_eq!((summary.steps_mean, summary.expert_steps_mean), (22.5, 20.0));
        let pickup = summary.skills[&SkillKind::Pickup];
        assert_eq!((pickup.reached, pickup.completed), (4, 3));
        let put = summary.skills[&SkillKind::Put];
        assert_eq!((put.reached, put.completed), (3, 2));
    }

    #[test]
    fn the_order_of_the_episodes_does_not_matter() {
        let (tasks, mut episodes) = sample();
        let summary = Summary::of(&manifest(), &tasks, &episodes, false);
        episodes.reverse();
        assert_eq!(Summary::of(&manifest(), &tasks, &episodes, false), summary);
    }

    #[test]
    fn a_run_without_episodes_still_has_a_summary() {
        let summary = Summary::of(&manifest(), &sample().0, &[], true);
        assert_eq!((summary.episodes, summary.success, summary.success_interval), (0, 0.0, [0.0, 1.0]));
        let text = serde_json::to_string(&summary).unwrap();
        assert!(!text.contains("null"), "{text}");
    }

    #[test]
    fn the_names_that_scripts_read_are_there() {
        let (tasks, episodes) = sample();
        let summary = serde_json::to_value(Summary::of(&manifest(), &tasks, &episodes, false)).unwrap();
        for name in ["/episodes", "/errors", "/success", "/success_interval/1", "/completed_subtasks/mean"] {
            assert!(summary.pointer(name).is_some_and(serde_json::Value::is_number), "{name}");
        }
        for name in ["/completed_subtasks/interval/0", "/progress_by_length/2", "/steps_mean", "/skills/Put/rate"] {
            assert!(summary.pointer(name).is_some_and(serde_json::Value::is_number), "{name}");
        }
    }
}
