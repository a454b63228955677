//! Which tasks are demonstrated: those that the generator finds in its houses, or given ones.

use std::ops::Range;

use crate::data::dataset::Counts;
use crate::domain::Task;
use crate::episode::scenes::Scenes;

/// Episodes in one house.
pub(super) const PER_HOUSE: usize = 4;
/// Houses, or given tasks, between two writes, at most.
const GROUP: usize = 32;
/// Where tasks to demonstrate come from.
pub enum TaskSource {
    /// Tasks that the generator finds in houses of its own.
    Generated {
        /// How many trajectories.
        episodes: usize,
        /// Task lengths, drawn uniformly; a length may be listed more than once.
        lengths: Vec<usize>,
        /// Phrasings of each trajectory.
        annotations: usize,
    },
    /// Each of these tasks once, in its own words.
    Tasks {
        /// What to demonstrate.
        tasks: Vec<Task>,
        /// The scenes that the tasks refer to.
        scenes: Scenes,
    },
}

impl TaskSource {
    /// The houses or tasks of the next group, by number, when those before `next` gave `made` trajectories.
    pub(super) fn numbers(&self, next: u64, made: usize) -> Option<Range<u64>> {
        let count = match self {
            TaskSource::Generated { episodes, .. } => GROUP.min(episodes.saturating_sub(made).div_ceil(PER_HOUSE)),
            TaskSource::Tasks { tasks, .. } => GROUP.min(tasks.len() - (next as usize).min(tasks.len())),
        };
        (count > 0).then(|| next..next + count as u64)
    }

    /// The most trajectories that there will be.
    pub(super) fn most(&self) -> usize {
        match self {
            TaskSource::Generated { episodes, .. } => *episodes,
            TaskSource::Tasks { tasks, .. } => tasks.len(),
        }
    }

    /// How far it has come, of [`TaskSource::most`].
    pub(super) fn done(&self, next: u64, counts: &Counts) -> u64 {
        match self {
            TaskSource::Generated { .. } => counts.trajectories,
            TaskSource::Tasks { .. } => next,
        }
    }

    pub(super) fn name(&self) -> &'static str {
        match self {
            TaskSource::Generated { .. } => "generated",
            TaskSource::Tasks { .. } => "tasks",
        }
    }
}
