//! What a run came to: rates and means with their intervals, as JSON, as a page, and as a table for spreadsheets.

use std::collections::BTreeMap;
use std::fmt::Write as _;

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
                means: format!("percentile bootstrap over tasks, 95 %, {} resamples, seed {BOOTSTRAP_SEED}", stats::RESAMPLES),
            },
        }
    }

    /// The page that people read.
    pub fn markdown(&self) -> String {
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let between = |[low, high]: Interval| format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high);
        let mut page = format!("# {} on {}\n\n", self.policy, self.task_set);
        if self.partial {
            page += "**Partial: the run was interrupted. Give the same command with this folder as --out to continue.**\n\n";
        }
        let mut row = |cells: &[String]| {
            // Writing to a String cannot fail.
            let _ = writeln!(page, "| {} |", cells.join(" | "));
        };
        let text = |text: &str| text.to_owned();
        row(&[text("measure"), text("value"), text("95 % interval")]);
        row(&[text("---"), text("---:"), text("---:")]);
        row(&[text("episodes"), self.episodes.to_string(), text("")]);
        row(&[text("errors (counted as failures)"), self.errors.to_string(), text("")]);
        row(&[text("success"), percent(self.success), between(self.success_interval)]);
        let [low, high] = self.completed_subtasks.interval;
        let mean = format!("{:.2}", self.completed_subtasks.mean);
        row(&[text("completed subtasks"), mean, format!("{low:.2} to {high:.2}")]);
        row(&[text("progress"), percent(self.progress.mean), between(self.progress.interval)]);
        let expert = format!("the expert's: {:.1}", self.expert_steps_mean);
        row(&[text("steps"), format!("{:.1}", self.steps_mean), expert]);
        row(&[]);
        row(&[text("subtasks of the task"), text("episodes"), text("success"), text("progress")]);
        row(&[text("---:"), text("---:"), text("---:"), text("---:")]);
        for (length, episodes) in &self.episodes_by_length {
            let share = |map: &BTreeMap<u32, f64>| percent(map.get(length).copied().unwrap_or_default());
            let (success, progress) = (share(&self.success_by_length), share(&self.progress_by_length));
            row(&[length.to_string(), episodes.to_string(), success, progress]);
        }
        row(&[]);
        row(&[text("skill"), text("reached"), text("completed"), text("rate"), text("95 % interval")]);
        row(&[text("---"), text("---:"), text("---:"), text("---:"), text("---:")]);
        for (kind, skill) in &self.skills {
            let (reached, completed) = (skill.reached.to_string(), skill.completed.to_string());
            row(&[format!("{kind:?}"), reached, completed, percent(skill.rate), between(skill.interval)]);
        }
        let page = page.replace("|  |\n", "\n");
        let grader = match self.grader {
            Grading::Class => "class",
            Grading::Strict => "strict",
        };
        let methods = &self.interval_methods;
        format!("{page}\nGrader: {grader}. Intervals: rates by {}; means by {}.\n", methods.rates, methods.means)
    }

    /// One row for the whole, for each length, and for each kind of skill.
    ///
    /// # Errors
    /// Never in practice: it writes to memory.
    pub fn csv(&self) -> anyhow::Result<Vec<u8>> {
        let mut table = csv::Writer::from_writer(Vec::new());
        table.write_record(["group", "measure", "count", "value", "low", "high"])?;
        let mut row = |group: &str, measure: &str, count: usize, value: f64, interval: Option<Interval>| {
            let [low, high] = interval.map_or_else(Default::default, |ends| ends.map(|end| end.to_string()));
            table.write_record([group, measure, &count.to_string(), &value.to_string(), &low, &high])
        };
        row("all", "success", self.episodes, self.success, Some(self.success_interval))?;
        let (completed, progress) = (self.completed_subtasks, self.progress);
        row("all", "completed_subtasks", self.episodes, completed.mean, Some(completed.interval))?;
        row("all", "progress", self.episodes, progress.mean, Some(progress.interval))?;
        row("all", "errors", self.episodes, self.errors as f64, None)?;
        row("all", "steps", self.episodes, self.steps_mean, None)?;
        row("all", "expert_steps", self.episodes, self.expert_steps_mean, None)?;
        for (length, &count) in &self.episodes_by_length {
            let group = format!("length {length}");
            let value = |map: &BTreeMap<u32, f64>| map.get(length).copied().unwrap_or_default();
            row(&group, "success", count, value(&self.success_by_length), None)?;
            row(&group, "progress", count, value(&self.progress_by_length), None)?;
        }
        for (kind, skill) in &self.skills {
            row(&format!("{kind:?}"), "completed", skill.reached, skill.rate, Some(skill.interval))?;
        }
        Ok(table.into_inner()?)
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

/// A figure that a run must reach, as `METRIC=X`.
#[derive(Clone, Debug, PartialEq)]
pub struct Threshold {
    metric: String,
    least: f64,
}

impl Threshold {
    /// What may stand left of the equals sign.
    pub const METRICS: &str = "success, completed_subtasks, progress, success_by_length.N, progress_by_length.N";

    /// The measured figure when it falls short; `None` when it is reached.
    ///
    /// # Errors
    /// When no episode has that many subtasks.
    pub fn missed_by(&self, summary: &Summary) -> anyhow::Result<Option<f64>> {
        let of_length = |map: &BTreeMap<u32, f64>, length: &str| length.parse().ok().and_then(|n: u32| map.get(&n).copied());
        let measured = match self.metric.split_once('.') {
            None => match self.metric.as_str() {
                "success" => Some(summary.success),
                "completed_subtasks" => Some(summary.completed_subtasks.mean),
                _ => Some(summary.progress.mean),
            },
            Some(("success_by_length", length)) => of_length(&summary.success_by_length, length),
            Some((_, length)) => of_length(&summary.progress_by_length, length),
        };
        let measured = measured.ok_or_else(|| anyhow::anyhow!("no episode tells {}: no task is that long", self.metric))?;
        Ok((measured < self.least).then_some(measured))
    }
}

impl std::fmt::Display for Threshold {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.metric, self.least)
    }
}

impl std::str::FromStr for Threshold {
    type Err = String;

    fn from_str(text: &str) -> Result<Threshold, String> {
        let (metric, least) = text.split_once('=').ok_or("write METRIC=X, for example success=0.8")?;
        let known = match metric.split_once('.') {
            None => matches!(metric, "success" | "completed_subtasks" | "progress"),
            Some((map, length)) => {
                matches!(map, "success_by_length" | "progress_by_length") && length.parse::<u32>().is_ok()
            }
        };
        if !known {
            return Err(format!("{metric:?} is not one of {}", Threshold::METRICS));
        }
        let least: f64 = least.parse().map_err(|_| format!("{least:?} is not a number"))?;
        if !least.is_finite() {
            return Err(format!("{least} is not a finite number"));
        }
        Ok(Threshold { metric: metric.to_owned(), least })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;
    use crate::run::folder::tests::{episode, manifest};

    fn sample() -> (Vec<Task>, Vec<Episode>) {
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

    #[test]
    fn the_page_and_the_table_look_as_agreed() {
        let (tasks, episodes) = sample();
        let summary = Summary::of(&manifest(), &tasks, &episodes, true);
        insta::assert_snapshot!(summary.markdown());
        insta::assert_snapshot!(String::from_utf8(summary.csv().unwrap()).unwrap());
    }

    #[test]
    fn a_threshold_is_missed_only_below_it() {
        let (tasks, episodes) = sample();
        let summary = Summary::of(&manifest(), &tasks, &episodes, false);
        let missed = |text: &str| text.parse::<Threshold>().unwrap().missed_by(&summary);
        assert_eq!(missed("success=0.5").unwrap(), None);
        assert_eq!(missed("success=0.51").unwrap(), Some(0.5));
        assert_eq!(missed("completed_subtasks=2").unwrap(), Some(1.25));
        assert_eq!(missed("progress_by_length.2=0.7").unwrap(), Some(0.625));
        assert!(missed("success_by_length.3=0.7").unwrap_err().to_string().contains("no task is that long"));
        for nonsense in ["success", "succes=1", "success=x", "success=NaN", "progress_by_length.x=1", "steps.2=1"] {
            assert!(nonsense.parse::<Threshold>().is_err(), "{nonsense}");
        }
    }
}
