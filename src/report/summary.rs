//! What a run came to: rates and means with their intervals.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::estimates::{Mean, SkillRate, interval_method};
use super::groups;
use super::groups::{EpisodesByTask, ErroredEpisode, FailureCount, GroupFigures, StartSubtaskFigures};
use super::stats;
use super::stats::Interval;
use crate::domain::{SkillKind, Task};
use crate::episode::failure::Failure;
use crate::episode::instruction_variant::InstructionVariant;
use crate::episode::record::Episode;
use crate::episode::rollout::EndedBy;
use crate::house::grading::Grading;
use crate::run_dir::manifest::RunManifest;

/// How the intervals were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct IntervalMethods {
    /// How intervals of rates were made.
    pub(crate) rates: String,
    /// How intervals of means were made.
    pub(crate) means: String,
}

/// The summary of a run. Its figures are of the episodes in the tasks' own words from their starts; those in other words or
/// from later subtasks have tables of their own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunSummary {
    /// Version of the format of `summary.json`.
    #[schemars(extend("const" = RunSummary::FORMAT))]
    pub(crate) format_version: u32,
    /// The name that the task file gives itself.
    pub(crate) task_set: String,
    /// The name of the policy that acted: of an agent, its checkpoint's.
    pub(crate) policy: String,
    /// The rules by which subtasks counted as completed.
    pub(crate) grader: Grading,
    /// Whose word ended an episode before its time.
    #[serde(default, skip_serializing_if = "EndedBy::is_grader")]
    pub(crate) end: EndedBy,
    /// The run was interrupted; only some of its episodes are in.
    pub(crate) partial: bool,
    /// Tasks with at least one episode.
    pub(crate) tasks: usize,
    /// Episodes, failed and errored ones included.
    pub(crate) episodes: usize,
    /// Episodes that ended with an error, in other words and from later subtasks too; they count as no success.
    pub(crate) errors: usize,
    /// The share of episodes in which every subtask was completed.
    pub(crate) success: f64,
    /// The 95 % Wilson interval of `success`, lower end first.
    pub(crate) success_interval: Interval,
    /// What an episode's steps earned together, where the environment tells.
    #[serde(rename = "return", default, skip_serializing_if = "Option::is_none")]
    pub(crate) earned: Option<Mean>,
    /// Completed subtasks of an episode.
    pub(crate) completed_subtasks: Mean,
    /// Completed subtasks of an episode as a share of its subtasks.
    pub(crate) progress: Mean,
    /// By the number of subtasks: mean completed ones as a share of them.
    pub(crate) progress_by_length: BTreeMap<u32, f64>,
    /// By the number of subtasks: the 95 % interval of that.
    pub(crate) progress_interval_by_length: BTreeMap<u32, Interval>,
    /// By the number of subtasks: the share of successes.
    pub(crate) success_by_length: BTreeMap<u32, f64>,
    /// By the number of subtasks: the episodes.
    pub(crate) episodes_by_length: BTreeMap<u32, usize>,
    /// By the kind of skill.
    pub skills: BTreeMap<SkillKind, SkillRate>,
    /// By the scene; generated houses by their room.
    pub(crate) scenes: BTreeMap<String, GroupFigures>,
    /// Mean steps of an episode, successful or not.
    pub(crate) steps_mean: f64,
    /// Steps that the expert takes, for the same episodes.
    pub(crate) expert_steps_mean: f64,
    /// Steps of a successful episode as a multiple of the expert's; nothing without any.
    pub(crate) steps_over_expert: Option<Mean>,
    /// Why episodes fell short, by class.
    pub(crate) failures: BTreeMap<Failure, FailureCount>,
    /// Every episode that ended with an error.
    pub(crate) errored_episodes: Vec<ErroredEpisode>,
    /// By instruction variant, where a run asked for them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) instruction_variants: BTreeMap<InstructionVariant, GroupFigures>,
    /// By the subtask from which the agent acted, where a run asked for it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) start_subtasks: BTreeMap<u32, StartSubtaskFigures>,
    /// By the kind of the first subtask that was the agent's own, where a run asked for it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) first_subtask_skills: BTreeMap<SkillKind, SkillRate>,
    /// SHA-256 of the episodes' lines in the run's order.
    pub(crate) episodes_hash: String,
    /// How the intervals were made.
    pub(crate) interval_methods: IntervalMethods,
}

impl RunSummary {
    /// The format version this program reads and writes.
    pub(crate) const FORMAT: u32 = 2;

    /// Sums up `episodes`, each of one of `tasks`; the order of the episodes does not matter.
    pub(crate) fn of(manifest: &RunManifest, tasks: &[Task], episodes: &[Episode], partial: bool) -> RunSummary {
        let every = EpisodesByTask::new(tasks, episodes);
        let plain = every.filter(|episode| episode.is_plain());
        let all = plain.iter();
        let lengths: BTreeSet<u32> = all.iter().map(|(_, episode)| episode.of).collect();
        let by_length = |value: fn(&Episode) -> f64| -> BTreeMap<u32, f64> {
            let of_length = |length| all.iter().filter(move |(_, e)| e.of == length).map(move |(_, e)| value(e));
            lengths.iter().map(|&length| (length, stats::mean(of_length(length)))).collect()
        };
        let count = |length| all.iter().filter(|(_, episode)| episode.of == length).count();
        let interval =
            |length: u32| Mean::of(&plain.filter(|e| e.of == length).values(Episode::progress), [0.0, 1.0]).interval;
        let longest = lengths.last().copied().map_or(0.0, f64::from);
        RunSummary {
            format_version: RunSummary::FORMAT,
            task_set: manifest.task_set.clone(),
            policy: manifest.policy.clone(),
            grader: manifest.grader,
            end: manifest.end,
            partial,
            tasks: plain.tasks(),
            episodes: all.len(),
            errors: every.iter().iter().filter(|(_, episode)| episode.error.is_some()).count(),
            success: stats::mean(all.iter().map(|(_, episode)| episode.succeeded())),
            success_interval: stats::wilson_of_groups(&plain.values(Episode::succeeded)),
            earned: earned(&plain),
            completed_subtasks: Mean::of(&plain.values(|episode| f64::from(episode.completed)), [0.0, longest]),
            progress: Mean::of(&plain.values(Episode::progress), [0.0, 1.0]),
            progress_by_length: by_length(Episode::progress),
            progress_interval_by_length: lengths.iter().map(|&length| (length, interval(length))).collect(),
            success_by_length: by_length(Episode::succeeded),
            episodes_by_length: lengths.iter().map(|&length| (length, count(length))).collect(),
            skills: groups::skills(&plain),
            scenes: plain.by_scene(),
            steps_mean: stats::mean(all.iter().map(|(_, episode)| f64::from(episode.steps))),
            expert_steps_mean: stats::mean(all.iter().map(|(task, _)| f64::from(task.expert_steps))),
            steps_over_expert: plain.steps_over_expert(),
            failures: groups::failures(&plain),
            errored_episodes: groups::errored(&every),
            instruction_variants: if manifest.instruction_variants {
                groups::instruction_variants(&every)
            } else {
                BTreeMap::new()
            },
            start_subtasks: if manifest.all_start_subtasks { groups::start_subtasks(&every) } else { BTreeMap::new() },
            first_subtask_skills: if manifest.all_start_subtasks {
                groups::first_subtask_skills(&every)
            } else {
                BTreeMap::new()
            },
            episodes_hash: String::new(),
            interval_methods: IntervalMethods {
                rates: match all.len() > plain.tasks() {
                    false => "Wilson score, 95 %".into(),
                    true => {
                        "Wilson score, 95 %, over the effective number of episodes: a task's seeds are alike".into()
                    }
                },
                means: interval_method(),
            },
        }
    }
}

/// The mean return of the episodes that have one.
fn earned(plain: &EpisodesByTask<'_>) -> Option<Mean> {
    let told = plain.filter(|episode| episode.earned.is_some());
    let values = told.values(|episode| episode.earned.unwrap_or_default());
    let all = || values.iter().flatten().copied();
    let bounds = [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)];
    all().next().is_some().then(|| Mean::of(&values, bounds))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;
    use crate::run_dir::episodes::tests::episode;
    use crate::run_dir::manifest::tests::manifest;

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
        let summary = RunSummary::of(&manifest(), &tasks, &episodes, false);
        assert_eq!((summary.tasks, summary.episodes, summary.errors), (2, 4, 1));
        assert_eq!(summary.errored_episodes.len(), 1);
        assert_eq!(summary.steps_over_expert.unwrap().mean, 1.5);
        assert_eq!(summary.scenes["FloorPlan7"].episodes, 2);
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
        let summary = RunSummary::of(&manifest(), &tasks, &episodes, false);
        episodes.reverse();
        assert_eq!(RunSummary::of(&manifest(), &tasks, &episodes, false), summary);
    }

    #[test]
    fn a_run_without_episodes_still_has_a_summary() {
        let summary = RunSummary::of(&manifest(), &sample().0, &[], true);
        assert_eq!((summary.episodes, summary.success, summary.success_interval), (0, 0.0, [0.0, 1.0]));
        assert_eq!(summary.steps_over_expert, None);
    }

    #[test]
    fn the_names_that_scripts_read_are_there() {
        let (tasks, episodes) = sample();
        let summary = serde_json::to_value(RunSummary::of(&manifest(), &tasks, &episodes, false)).unwrap();
        for name in ["/episodes", "/errors", "/success", "/success_interval/1", "/completed_subtasks/mean"] {
            assert!(summary.pointer(name).is_some_and(serde_json::Value::is_number), "{name}");
        }
        for name in ["/completed_subtasks/interval/0", "/progress_by_length/2", "/steps_mean", "/skills/Put/rate"] {
            assert!(summary.pointer(name).is_some_and(serde_json::Value::is_number), "{name}");
        }
    }
}
