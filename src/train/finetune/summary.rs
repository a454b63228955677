//! What a finetuning came to: the mean over tasks at every step that all of them have, and a table of the tasks.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::task_training::STAGE;
use crate::data::{atomic_file, json};
use crate::domain::Task;
use crate::episode::instruction_variant::task_instruction;
use crate::report::charts::training_curves::{self, Curves};
use crate::report::estimates::Mean;
use crate::report::markdown_table::table;
use crate::report::stats::Interval;
use crate::train::metrics::Scalars;

/// The curves that are averaged over tasks, with the bounds of their values.
const AVERAGED: [(&str, Interval); 4] = [
    ("return", [0.0, 1.0]),
    ("rollout_return", [0.0, 1.0]),
    ("success", [0.0, 1.0]),
    ("completed_subtasks", [0.0, f64::INFINITY]),
];

/// `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FinetuneSummary {
    pub(crate) format_version: u32,
    /// The method as the checkpoint's `config.json` names it, such as `sprint`, `bc` or `am`.
    pub(crate) method: String,
    /// The name of the checkpoint's folder.
    pub(crate) checkpoint: String,
    /// The name of the task set.
    pub(crate) task_set: String,
    /// Environment steps of each task's training.
    pub(crate) steps: u64,
    /// Each task.
    pub(crate) tasks: Vec<FinetunedTask>,
    /// Of a greedy rollout before the first update.
    pub(crate) zero_shot_return: Mean,
    /// Of a greedy rollout after the last one.
    pub(crate) finetuned_return: Mean,
    /// Of the initial rollouts, which explore.
    pub(crate) first_rollout_return: Mean,
    /// Of the exploring rollouts between the last two measurements.
    pub(crate) last_rollout_return: Mean,
}

/// What came of one task. A return is the share of the task's subtasks that is completed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FinetunedTask {
    /// Its number in the set, from 1.
    pub(crate) number: usize,
    /// Its id.
    pub(crate) id: String,
    /// What the agent is told.
    pub(crate) instruction: String,
    /// How many subtasks it has.
    pub(crate) subtasks: usize,
    pub(crate) zero_shot_return: f64,
    pub(crate) finetuned_return: f64,
    pub(crate) first_rollout_return: f64,
    pub(crate) last_rollout_return: f64,
    pub(crate) rollouts: u64,
    pub(crate) updates: u64,
    /// The checkpoint's folder, relative to this file.
    pub(crate) folder: PathBuf,
}

/// What a summary is of.
pub(super) struct Heading<'a> {
    pub(super) method: &'a str,
    pub(super) checkpoint: &'a Path,
    pub(super) task_set: &'a str,
    pub(super) steps: u64,
}

/// A task that was trained on: its number, itself, and the folder of its checkpoint within `out`.
pub(super) type Finished<'a> = (usize, &'a Task, PathBuf);

impl FinetuneSummary {
    /// The format version this program writes.
    const FORMAT: u32 = 1;

    /// Of the curves that the tasks' trainings wrote.
    ///
    /// # Errors
    /// When a curve cannot be read.
    pub(super) fn of(out: &Path, heading: &Heading<'_>, finished: &[Finished<'_>]) -> anyhow::Result<FinetuneSummary> {
        let tasks = finished.iter().map(|finished| FinetunedTask::of(out, finished));
        let tasks = tasks.collect::<anyhow::Result<Vec<_>>>()?;
        let over_tasks = |of: fn(&FinetunedTask) -> f64| {
            Mean::of(&tasks.iter().map(|task| vec![of(task)]).collect::<Vec<_>>(), [0.0, 1.0])
        };
        Ok(FinetuneSummary {
            format_version: FinetuneSummary::FORMAT,
            method: heading.method.to_owned(),
            checkpoint: heading.checkpoint.file_name().map_or_else(String::new, |name| name.to_string_lossy().into()),
            task_set: heading.task_set.to_owned(),
            steps: heading.steps,
            zero_shot_return: over_tasks(|task| task.zero_shot_return),
            finetuned_return: over_tasks(|task| task.finetuned_return),
            first_rollout_return: over_tasks(|task| task.first_rollout_return),
            last_rollout_return: over_tasks(|task| task.last_rollout_return),
            tasks,
        })
    }

    /// Writes `summary.json` and `summary.md`.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub(super) fn write(&self, out: &Path) -> anyhow::Result<()> {
        json::write_pretty(&out.join("summary.json"), self)?;
        atomic_file::write(&out.join("summary.md"), self.markdown().as_bytes())
    }

    /// The page that people read.
    pub(crate) fn markdown(&self) -> String {
        let number = |value: f64| format!("{value:.2}");
        let mean = |Mean { mean, interval: [low, high] }: Mean| format!("{mean:.2} ({low:.2} to {high:.2})");
        let row = |task: &FinetunedTask| {
            [
                format!("{} {}", task.number, task.instruction),
                task.subtasks.to_string(),
                number(task.zero_shot_return),
                number(task.finetuned_return),
                number(task.first_rollout_return),
                number(task.last_rollout_return),
                task.rollouts.to_string(),
                task.updates.to_string(),
            ]
        };
        let all = [
            format!("mean of {}", self.tasks.len()),
            String::new(),
            mean(self.zero_shot_return),
            mean(self.finetuned_return),
            mean(self.first_rollout_return),
            mean(self.last_rollout_return),
            String::new(),
            String::new(),
        ];
        let head = [
            "task",
            "subtasks",
            "zero-shot return",
            "return after",
            "initial rollouts",
            "last rollouts",
            "rollouts",
            "updates",
        ];
        format!(
            "# {} ({}) finetuned on {}, {} steps a task\n\n{}\n\
             A return is the share of a task's subtasks that is completed: greedy before the first update and after the last \
             one, and of the exploring rollouts, the initial ones and those between the last two measurements. Intervals: 95 %, \
             bootstrap over tasks.\n",
            self.checkpoint,
            self.method,
            self.task_set,
            self.steps,
            table(head, self.tasks.iter().map(row).chain([all]))
        )
    }
}

impl FinetunedTask {
    fn of(out: &Path, (number, task, folder): &Finished<'_>) -> anyhow::Result<FinetunedTask> {
        let curves = training_curves::read(&out.join(folder))?;
        let curve = |name: &str| curves.get(&format!("{STAGE}/{name}")).cloned().unwrap_or_default();
        let first = |name: &str| curve(name).first_key_value().map_or(0.0, |(_, &value)| value);
        let last = |name: &str| curve(name).last_key_value().map_or(0.0, |(_, &value)| value);
        Ok(FinetunedTask {
            number: *number,
            id: task.id.clone(),
            instruction: task_instruction(task, false),
            subtasks: task.subtasks.len(),
            zero_shot_return: first("return"),
            finetuned_return: last("return"),
            first_rollout_return: first("rollout_return"),
            last_rollout_return: last("rollout_return"),
            rollouts: last("rollouts") as u64,
            updates: last("updates") as u64,
            folder: folder.clone(),
        })
    }
}

/// Writes the means over the tasks as curves of their own, with the ends of their intervals, at every step that all tasks have.
///
/// # Errors
/// When a curve cannot be read, or the means not be written.
pub(super) fn write_means(out: &Path, folders: &[PathBuf], steps: u64) -> anyhow::Result<()> {
    let curves = folders.iter().map(|folder| training_curves::read(&out.join(folder)));
    let text = means(&curves.collect::<anyhow::Result<Vec<_>>>()?, steps)?;
    atomic_file::write(&out.join("training/progress.jsonl"), text.as_bytes())
}

fn means(tasks: &[Curves], steps: u64) -> anyhow::Result<String> {
    let mut found: BTreeMap<u64, Scalars> = BTreeMap::new();
    for (name, bounds) in AVERAGED {
        let curve = |curves: &Curves| curves.get(&format!("{STAGE}/{name}")).cloned().unwrap_or_default();
        let curves: Vec<BTreeMap<u64, f64>> = tasks.iter().map(curve).collect();
        let every: BTreeSet<u64> = curves.iter().flat_map(|curve| curve.keys().copied()).collect();
        for step in every {
            let at: Vec<Vec<f64>> = curves.iter().filter_map(|curve| Some(vec![*curve.get(&step)?])).collect();
            if at.len() < tasks.len() {
                continue;
            }
            // A mean without width has no bound where its values have none.
            let Mean { mean, interval: [low, high] } = Mean::of(&at, bounds);
            let scalars = found.entry(step).or_insert_with(|| Scalars::new(STAGE, step, steps));
            scalars.set(name, mean);
            if high.is_finite() {
                scalars.set(&format!("{name}_low"), low);
                scalars.set(&format!("{name}_high"), high);
            }
        }
    }
    let mut text = String::new();
    for scalars in found.values() {
        text += &serde_json::to_string(scalars)?;
        text.push('\n');
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curves(values: &[(u64, f64)]) -> Curves {
        [(format!("{STAGE}/return"), values.iter().copied().collect())].into()
    }

    #[test]
    fn means_are_taken_where_every_task_has_a_number() {
        let text = means(&[curves(&[(0, 0.0), (10, 0.5), (20, 1.0)]), curves(&[(0, 0.5), (10, 1.0)])], 20).unwrap();
        let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(lines.len(), 2, "{text}");
        assert_eq!((lines[0]["step"].as_u64(), lines[0]["return"].as_f64()), (Some(0), Some(0.25)));
        assert_eq!(lines[1]["return"].as_f64(), Some(0.75));
        let at = |name: &str| lines[1][name].as_f64().unwrap();
        assert!(at("return_low") <= 0.75 && 0.75 <= at("return_high"), "{text}");
    }

    #[test]
    fn a_summary_tells_what_each_task_came_to_and_their_means() {
        let folder = tempfile::tempdir().unwrap();
        let task = crate::data::taskset::tests::sample_set().tasks.remove(0);
        for (name, returns) in [("a", [0.0, 1.0]), ("b", [0.5, 0.5])] {
            std::fs::create_dir_all(folder.path().join(name).join("training")).unwrap();
            let line = |step: u64, value: f64| {
                let mut scalars = Scalars::new(STAGE, step, 20);
                scalars.set("return", value);
                scalars.set("updates", step as f64);
                serde_json::to_string(&scalars).unwrap() + "\n"
            };
            let text = line(0, returns[0]) + &line(20, returns[1]);
            std::fs::write(folder.path().join(name).join("training/progress.jsonl"), text).unwrap();
        }
        let heading = Heading { method: "bc", checkpoint: Path::new("x/agent"), task_set: "set", steps: 20 };
        let finished = [(1, &task, PathBuf::from("a")), (2, &task, PathBuf::from("b"))];
        let summary = FinetuneSummary::of(folder.path(), &heading, &finished).unwrap();
        assert_eq!((summary.zero_shot_return.mean, summary.finetuned_return.mean), (0.25, 0.75));
        assert_eq!((summary.tasks[0].finetuned_return, summary.tasks[1].updates), (1.0, 20));
        let page = summary.markdown();
        assert!(
            page.starts_with("# agent (bc) finetuned on set, 20 steps a task") && page.contains("mean of 2"),
            "{page}"
        );
        summary.write(folder.path()).unwrap();
        let written = std::fs::read_to_string(folder.path().join("summary.json")).unwrap();
        assert_eq!(serde_json::from_str::<FinetuneSummary>(&written).unwrap(), summary);
    }
}
