//! Whether a record belongs to its run: a line that parses may still be of another run, or contradict itself.

use std::collections::{BTreeSet, HashMap};

use super::episode_spec::own_specs;
use super::manifest::RunManifest;
use crate::data::taskset::LONGEST_HORIZON;
use crate::domain::Task;
use crate::episode::record::{Episode, EpisodeKey};
use crate::language::count::counted;

/// What the records of a run can be.
pub(crate) struct RecordCheck<'a> {
    manifest: &'a RunManifest,
    tasks: HashMap<&'a str, &'a Task>,
    /// The episodes of a share; nothing for a whole run.
    share: Option<BTreeSet<EpisodeKey>>,
}

impl<'a> RecordCheck<'a> {
    pub(crate) fn new(manifest: &'a RunManifest, tasks: &'a [Task]) -> RecordCheck<'a> {
        let keys = || own_specs(manifest, tasks).into_iter().map(|spec| spec.key(tasks)).collect();
        RecordCheck {
            manifest,
            tasks: tasks.iter().map(|task| (task.id.as_str(), task)).collect(),
            share: manifest.shard.map(|_| keys()),
        }
    }

    /// Checks a record against the run, and against itself.
    ///
    /// # Errors
    /// Says which record, and what of it cannot be.
    pub(crate) fn check(&self, episode: &Episode) -> Result<(), String> {
        let Some(task) = self.tasks.get(episode.task.as_str()) else {
            return Err(format!("the run has no task {:?}", episode.task));
        };
        match self.misfit(episode, task) {
            Some(misfit) => Err(format!("{}: {misfit}", episode.key())),
            None => Ok(()),
        }
    }

    fn misfit(&self, episode: &Episode, task: &Task) -> Option<String> {
        let Episode { completed, of, steps, start_subtask, .. } = *episode;
        let length = task.subtasks.len() as u32;
        // A person may have been told more than a task asks, and had no horizon.
        let explored = episode.is_explored() || self.manifest.policy == RunManifest::EXPLORED;
        let untold = length == 0;
        let starts = if self.manifest.all_start_subtasks { length } else { 1 };
        let horizon = if explored { LONGEST_HORIZON } else { task.horizon };
        if episode.seed >= self.manifest.seeds {
            let seeds = self.manifest.seeds;
            return Some(format!("seed: {}, but the run has {} from 0 on", episode.seed, counted(seeds, "seed")));
        }
        if !(episode.variant.is_original() || self.manifest.instruction_variants) {
            return Some("variant: the run plays the tasks' own instructions only".into());
        }
        if start_subtask >= starts && !(start_subtask == 0 || untold && self.manifest.all_start_subtasks) {
            return Some(format!("start_subtask: {start_subtask}, and the run begins before {starts} at the latest"));
        }
        if self.share.as_ref().is_some_and(|own| !own.contains(&episode.key())) {
            return Some("it belongs to another share of the run".into());
        }
        if !(explored || untold) && of != length - start_subtask {
            return Some(format!("of: {of}, but the task asks {}", counted(length - start_subtask, "subtask")));
        }
        if completed > of {
            return Some(format!("completed: {completed} of {}", counted(of, "subtask")));
        }
        if steps > horizon {
            return Some(format!("steps: {steps}, but its horizon is {horizon}"));
        }
        if episode.prefix_steps > 0 && episode.prefix_steps as usize > episode.trace.len() && !episode.trace.is_empty()
        {
            return Some(format!("prefix_steps: {} of {} steps", episode.prefix_steps, episode.trace.len()));
        }
        let is_success = episode.is_success(self.manifest.end);
        if episode.success && !is_success || is_success && !episode.success && !explored {
            let error = if episode.error.is_some() { " and an error" } else { "" };
            return Some(format!(
                "success: {}, with {completed} of {}{error}",
                episode.success,
                counted(of, "subtask")
            ));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;
    use crate::run_dir::manifest::tests::manifest;
    use crate::run_dir::shard::Shard;

    /// What is changed of a good record.
    type Change<'a> = &'a dyn Fn(&mut Episode);

    #[test]
    fn a_record_of_another_run_and_one_that_contradicts_itself_are_named() {
        let set = sample_set();
        let task = &set.tasks[0];
        let length = task.subtasks.len() as u32;
        let good = Episode { task: task.id.clone(), of: length, steps: task.horizon, ..Episode::default() };
        let manifest = RunManifest { tasks: set.tasks.len(), ..manifest() };
        let checked = |change: &dyn Fn(&mut Episode)| {
            let mut episode = good.clone();
            change(&mut episode);
            RecordCheck::new(&manifest, &set.tasks).check(&episode).err().unwrap_or_default()
        };
        assert_eq!(checked(&|_| ()), "");
        assert_eq!(checked(&|it| (it.completed, it.success) = (length, true)), "");
        assert_eq!(checked(&|it| it.error = Some("timed out".into())), "");
        let faults: [(Change<'_>, &str); 11] = [
            (&|it| it.task = "nobody".into(), "no task \"nobody\""),
            (&|it| it.seed = 1, "seed:"),
            (&|it| it.start_subtask = 1, "start_subtask:"),
            (&|it| it.start_subtask = u32::MAX, "start_subtask:"),
            (&|it| it.of += 1, "of:"),
            (&|it| it.completed = 99, "completed: 99"),
            (&|it| it.steps = u32::MAX, "steps: 4294967295"),
            (&|it| it.steps += 1, "steps:"),
            (&|it| it.success = true, "success: true, with 0"),
            (&|it| it.completed = length, "success: false, with"),
            (
                &|it| {
                    (it.completed, it.success) = (length, true);
                    it.error = Some("timed out".into());
                },
                "and an error",
            ),
        ];
        for (change, told) in faults {
            let found = checked(change);
            assert!(found.contains(told) && found.contains("task"), "{told}: {found:?}");
        }
        let share = RunManifest { seeds: 2, shard: Some(Shard { index: 1, of: 2 }), ..manifest.clone() };
        let last = set.tasks.last().map(|task| Episode {
            task: task.id.clone(),
            seed: 1,
            of: task.subtasks.len() as u32,
            ..Episode::default()
        });
        let told = RecordCheck::new(&share, &set.tasks).check(&last.unwrap()).unwrap_err();
        assert!(told.contains("another share"), "{told}");
    }
}
