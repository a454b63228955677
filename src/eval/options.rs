//! How a task set is evaluated.

use std::time::Duration;

use crate::agent::DecisionOverride;
use crate::episode::rollout::EndedBy;
use crate::house::grading::Grading;
use crate::run_dir::shard::Shard;

/// How to evaluate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How subtasks are graded.
    pub grading: Grading,
    /// Whose word ends an episode before its time.
    pub end: EndedBy,
    /// Each task is played this often, with the seeds 0, 1, ...
    pub seeds: u64,
    /// Only that many tasks, from the first.
    pub limit: Option<usize>,
    /// Threads; the result does not depend on it.
    pub jobs: usize,
    /// The agent is told all steps instead of the task's instruction.
    pub step_by_step: bool,
    /// The agent draws its actions by chance instead of taking the likeliest.
    pub sampling: bool,
    /// What is asked of the agent's decisions in place of what its checkpoint says.
    pub deciding: DecisionOverride,
    /// Each task is also played in every other wording.
    pub language: bool,
    /// Each task is also played from each of its subtasks on; the expert does those before.
    pub every_start: bool,
    /// An episode that ends with an error is begun anew at most this often.
    pub retries: u32,
    /// An episode that takes longer ends with an error; `None` for no limit.
    pub timeout: Option<Duration>,
    /// Only this share of the episodes.
    pub shard: Option<Shard>,
}

impl Options {
    /// Each task once, from its start, in its own words, on one thread.
    pub fn plain(grading: Grading) -> Options {
        Options {
            grading,
            end: EndedBy::Grader,
            seeds: 1,
            limit: None,
            jobs: 1,
            step_by_step: false,
            sampling: false,
            deciding: DecisionOverride::default(),
            language: false,
            every_start: false,
            retries: 0,
            timeout: None,
            shard: None,
        }
    }
}
