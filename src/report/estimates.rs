//! Estimates with their 95 % intervals, as summaries and comparisons give them.

use serde::{Deserialize, Serialize};

use super::stats;
use super::stats::Interval;

/// Drives the resampling of the bootstrap.
pub(crate) const BOOTSTRAP_SEED: u64 = 0;

/// How [`Mean`]s come by their intervals, in words.
pub(crate) fn interval_method() -> String {
    format!(
        "percentile bootstrap over tasks, 95 %, {} resamples, seed {BOOTSTRAP_SEED} (of one task, or where all are alike: a \
         bound by Wilson's score of how many tasks may differ)",
        stats::RESAMPLES
    )
}

/// A mean and its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Mean {
    /// The mean of all episodes, whatever their task.
    pub(crate) mean: f64,
    /// Its 95 % interval, lower end first: bootstrap over tasks, or, where that has no width, a bound.
    pub(crate) interval: Interval,
}

impl Mean {
    /// Of the values of each task's episodes, which lie within `bounds`.
    pub(crate) fn of(groups: &[Vec<f64>], bounds: Interval) -> Mean {
        let mean = stats::mean(groups.iter().flatten().copied());
        Mean { mean, interval: stats::bounded_mean(groups, bounds, BOOTSTRAP_SEED) }
    }
}

/// How often the skills of one kind, once reached, were completed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkillRate {
    /// Subtasks of the kind whose turn came.
    pub(crate) reached: usize,
    /// Subtasks among those that were completed.
    pub(crate) completed: usize,
    /// `completed` as a share of `reached`; 0 when none was reached.
    pub(crate) rate: f64,
    /// The 95 % Wilson interval of the rate, lower end first.
    pub(crate) interval: Interval,
}

impl SkillRate {
    /// Of each task's subtasks of the kind whose turn came: 1 where it was completed, else 0.
    pub(crate) fn of(groups: &[Vec<f64>]) -> SkillRate {
        let (reached, completed) = (groups.iter().map(Vec::len).sum(), groups.iter().flatten().sum::<f64>() as usize);
        let rate = if reached == 0 { 0.0 } else { completed as f64 / reached as f64 };
        SkillRate { reached, completed, rate, interval: stats::wilson_of_groups(groups) }
    }
}
