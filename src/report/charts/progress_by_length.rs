//! The plot of a run: progress by the number of subtasks.

use super::drawing::Drawing;
use super::line_chart::{LineChart, Series};
use crate::report::summary::RunSummary;

/// The name of the plot's files, without their ending.
pub(crate) const FILE_STEM: &str = "progress_by_length";

/// Progress by the number of subtasks, a line a run.
pub(crate) fn draw(summaries: &[&RunSummary]) -> Drawing {
    let line = |summary: &&RunSummary| Series {
        name: format!("{} ({})", summary.policy, summary.episodes),
        points: summary.progress_by_length.iter().map(|(&length, &share)| (f64::from(length), share)).collect(),
        intervals: summary.progress_interval_by_length.values().copied().collect(),
    };
    let set = summaries.first().map_or("", |summary| summary.task_set.as_str());
    let chart = LineChart {
        title: format!("Progress on {set}"),
        x_label: "subtasks of the task".into(),
        series: summaries.iter().map(line).collect(),
        y_range: Some((0.0, 1.0)),
    };
    chart.drawing(640.0, 400.0)
}
