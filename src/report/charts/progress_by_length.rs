//! The plots of a run.

use std::path::Path;

use super::drawing::Drawing;
use super::line_chart::{Chart, Line};
use crate::data::atomic_file;
use crate::report::summary::Summary;

/// The name of the plot of progress by length, without its ending.
pub const PROGRESS: &str = "progress_by_length";

/// Progress by the number of subtasks, a line a run.
pub fn progress_by_length(summaries: &[&Summary]) -> Drawing {
    let line = |summary: &&Summary| Line {
        name: format!("{} ({})", summary.policy, summary.episodes),
        points: summary.progress_by_length.iter().map(|(&length, &share)| (f64::from(length), share)).collect(),
        intervals: summary.progress_interval_by_length.values().copied().collect(),
    };
    let set = summaries.first().map_or("", |summary| summary.task_set.as_str());
    let chart = Chart {
        title: format!("Progress on {set}"),
        across: "subtasks of the task".into(),
        lines: summaries.iter().map(line).collect(),
        vertical: Some((0.0, 1.0)),
    };
    chart.drawing(640.0, 400.0)
}

/// Writes a drawing in both forms, each atomically.
///
/// # Errors
/// When the folder cannot be written to.
pub fn write(folder: &Path, name: &str, drawing: &Drawing) -> anyhow::Result<()> {
    atomic_file::write(&folder.join(format!("{name}.svg")), drawing.svg().as_bytes())?;
    atomic_file::write(&folder.join(format!("{name}.png")), &drawing.png()?)
}
