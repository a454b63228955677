//! The plots of a run and of a training.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, ensure};

use super::chart::{Chart, Line};
use super::report::Summary;
use crate::data::json;

/// The name of the plot of progress by length, without its ending.
pub const PROGRESS: &str = "progress_by_length";
/// The name of the plot of a training's curves, without its ending.
pub const CURVES: &str = "learning_curves";
/// Numbers of a training that are shares, and so fit on one axis.
const SHARES: &str = "accuracy";

/// Progress by the number of subtasks, a line a run.
pub fn progress_by_length(summaries: &[&Summary]) -> Chart {
    let line = |summary: &&Summary| Line {
        name: format!("{} ({})", summary.policy, summary.episodes),
        points: summary.progress_by_length.iter().map(|(&length, &share)| (f64::from(length), share)).collect(),
        intervals: summary.progress_interval_by_length.values().copied().collect(),
    };
    let set = summaries.first().map_or("", |summary| summary.task_set.as_str());
    Chart {
        title: format!("Progress on {set}"),
        across: "subtasks of the task".into(),
        lines: summaries.iter().map(line).collect(),
        highest: 1.0,
    }
}

/// The curves of a training's journal (`training/progress.jsonl`): its shares on an axis to 1, its losses as they come.
///
/// # Errors
/// When the journal cannot be read or holds no numbers; names the file and line.
pub fn learning_curves(journal: &Path) -> anyhow::Result<Vec<(String, Chart)>> {
    let name = journal.display();
    let text = std::fs::read_to_string(journal).with_context(|| format!("cannot read {name}"))?;
    let mut curves: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
    for (number, line) in (1..).zip(text.lines().filter(|line| !line.trim().is_empty())) {
        let entry: serde_json::Map<String, serde_json::Value> = serde_json::from_str(line)
            .with_context(|| format!("{name}: line {number} is not an entry of a journal"))?;
        let (Some(stage), Some(step)) =
            (entry.get("stage").and_then(|v| v.as_str()), entry.get("step").and_then(|v| v.as_f64()))
        else {
            continue;
        };
        for (key, value) in entry.iter().filter(|(key, _)| !matches!(key.as_str(), "step" | "of")) {
            if let Some(value) = value.as_f64().filter(|value| value.is_finite()) {
                curves.entry(format!("{stage} {}", key.replace('_', " "))).or_default().push((step, value));
            }
        }
    }
    ensure!(!curves.is_empty(), "{name} holds no numbers");
    let chart = |title: &str, wanted: bool| {
        let chosen = curves.iter().filter(|(key, _)| key.contains(SHARES) == wanted);
        let lines: Vec<Line> =
            chosen.map(|(key, points)| Line { name: key.clone(), points: points.clone(), intervals: vec![] }).collect();
        let top = lines.iter().flat_map(|line| line.points.iter().map(|point| point.1)).fold(0.0, f64::max);
        let highest = if wanted { 1.0 } else { top };
        Chart { title: title.into(), across: "training step".into(), lines, highest }
    };
    let charts =
        [(format!("{CURVES}_accuracy"), chart("Accuracy", true)), (CURVES.to_string(), chart("Losses", false))];
    Ok(charts.into_iter().filter(|(_, chart)| !chart.lines.is_empty()).collect())
}

/// Writes a chart in both forms, each atomically.
///
/// # Errors
/// When the folder cannot be written to.
pub fn write(folder: &Path, name: &str, chart: &Chart) -> anyhow::Result<()> {
    json::write_bytes(&folder.join(format!("{name}.svg")), chart.svg().as_bytes())?;
    json::write_bytes(&folder.join(format!("{name}.png")), &chart.png()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_journal_becomes_curves_and_a_broken_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("progress.jsonl");
        let entry = |step: u32| {
            format!(
                "{{\"stage\":\"policy\",\"step\":{step},\"of\":9,\"action_accuracy\":0.5,\"action_loss\":{step}.0}}\n"
            )
        };
        std::fs::write(&path, entry(1) + &entry(2)).unwrap();
        let curves = learning_curves(&path).unwrap();
        assert_eq!(curves.len(), 2);
        assert_eq!(curves[1].1.lines[0].points, [(1.0, 1.0), (2.0, 2.0)]);
        assert_eq!(curves[1].1.highest, 2.0);
        std::fs::write(&path, entry(1) + "{\n").unwrap();
        assert!(learning_curves(&path).unwrap_err().to_string().contains("line 2"));
    }
}
