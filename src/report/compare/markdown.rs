//! A comparison as a page for people.

use std::collections::BTreeSet;

use super::paired::{OutcomeChange, PairedComparison, PairedDifference};
use super::{Comparison, RunFigures};
use crate::language::count::counted;
use crate::report::markdown_table::{aligned_table, between, percent, table};

impl Comparison {
    /// The page that people read.
    pub fn markdown(&self) -> String {
        let mut parts = vec![self.run_table(), self.length_table()];
        if self.pairs.len() > 1 {
            parts.push(self.pair_table());
        }
        parts.extend(self.pairs.iter().map(PairedComparison::markdown));
        if let Some(pair) = self.pairs.first() {
            parts.push(format!(
                "Methods: rates by Wilson's score, by tasks where they were played with several seeds; {}.\n",
                pair.methods
            ));
        }
        parts.join("\n")
    }

    /// Every further run against the first, in a row.
    fn pair_table(&self) -> String {
        let with_interval = |figure: PairedDifference, show: fn(f64) -> String| {
            let [low, high] = figure.interval.map(show);
            format!("{} ({low} to {high})", show(figure.difference))
        };
        let row = |pair: &PairedComparison| {
            let (fell, rose) = (pair.regressions.len().to_string(), pair.fixes.len().to_string());
            let success = with_interval(pair.success, points);
            let completed = with_interval(pair.completed_subtasks, signed);
            [label(&pair.second), pair.pairs.to_string(), success, p(pair.mcnemar_p), completed, fell, rose]
        };
        let against = format!("against {}", self.pairs.first().map(|pair| label(&pair.first)).unwrap_or_default());
        let head = [&against, "pairs", "success", "McNemar p", "completed", "regressions", "fixes"];
        table(head, self.pairs.iter().map(row))
    }

    /// Every run in a row.
    fn run_table(&self) -> String {
        let row = |run: &RunFigures| {
            let [low, high] = run.completed_subtasks.interval;
            let each: Vec<String> = run.completed_subtasks_by_folder.iter().map(|mean| format!("{mean:.2}")).collect();
            [
                label(&run.run),
                run.policy.clone() + run.end.in_words(),
                run.episodes.to_string(),
                run.errors.to_string(),
                percent(run.success),
                between(run.success_interval),
                format!("{:.2}", run.completed_subtasks.mean),
                format!("{low:.2} to {high:.2}"),
                each.join(" "),
            ]
        };
        let head =
            ["run", "policy", "episodes", "errors", "success", "95 % interval", "completed", "95 % interval", "each"];
        let mut rows: Vec<Vec<String>> = self.runs.iter().map(|run| row(run).into()).collect();
        // One folder a run is the rule: only where there are more, the last column has something to say.
        let columns = head.len() - usize::from(self.runs.iter().all(|run| run.completed_subtasks_by_folder.is_empty()));
        rows.iter_mut().for_each(|row| row.truncate(columns));
        aligned_table(&head[..columns].iter().map(ToString::to_string).collect::<Vec<_>>(), &rows)
    }

    /// Progress, in all and by length.
    fn length_table(&self) -> String {
        let lengths: BTreeSet<u32> = self.runs.iter().flat_map(|run| run.progress_by_length.keys().copied()).collect();
        let head = ["progress by subtasks of the task".to_owned(), "all".into()];
        let head: Vec<String> = head.into_iter().chain(lengths.iter().map(u32::to_string)).collect();
        let row = |run: &RunFigures| -> Vec<String> {
            let share =
                |length| run.progress_by_length.get(length).map_or_else(String::new, |share| format!("{share:.2}"));
            [label(&run.run), format!("{:.2}", run.progress)].into_iter().chain(lengths.iter().map(share)).collect()
        };
        aligned_table(&head, &self.runs.iter().map(row).collect::<Vec<_>>())
    }
}

/// A run's folder as tables show it: of several the first, and how many there are besides.
fn label(run: &str) -> String {
    match run.split_once(',') {
        Some((first, others)) => format!("{first} and {} more", 1 + others.matches(',').count()),
        None => run.to_owned(),
    }
}

impl PairedComparison {
    fn markdown(&self) -> String {
        let row = |name: &str, figure: PairedDifference, show: fn(f64) -> String, change: fn(f64) -> String| {
            let [low, high] = figure.interval.map(change);
            let (first, second) = (show(figure.first), show(figure.second));
            [name.to_owned(), first, second, change(figure.difference), format!("{low} to {high}")]
        };
        let number = |value: f64| format!("{value:.2}");
        let rows = [
            row("success", self.success, percent, points),
            row("completed subtasks", self.completed_subtasks, number, signed),
            row("progress", self.progress, percent, points),
        ];
        let lost = match (self.unpaired, self.start_mismatches) {
            (0, _) => String::new(),
            (1, 0) => " 1 episode has no counterpart and is left out.".into(),
            (1, _) => " 1 episode has no counterpart and is left out, for another start.".into(),
            (n, 0) => format!(" {n} episodes have no counterpart and are left out."),
            (n, m) => format!(" {n} episodes have no counterpart and are left out, {m} of them for another start."),
        };
        let mut text = format!(
            "## {} against {}\n\n{} of episodes (same task, seed and start).{lost}\n\n{}\n",
            label(&self.second),
            label(&self.first),
            counted(self.pairs, "pair"),
            table(["measure", "first", "second", "difference", "95 % interval"], rows)
        );
        text += &format!(
            "McNemar: p {} (tasks solved more often in the first: {}, in the second: {}).\n",
            p(self.mcnemar_p),
            self.discordant_tasks[0],
            self.discordant_tasks[1]
        );
        for (title, changes) in [("Regressions", &self.regressions), ("Fixes", &self.fixes)] {
            if !changes.is_empty() {
                text += &format!(
                    "\n### {title}\n\n{}",
                    table(["task", "seed", "completed", "instruction", "open"], changes.iter().map(change_row))
                );
            }
        }
        text
    }
}

fn change_row(change: &OutcomeChange) -> [String; 5] {
    let [first, second, of] = change.completed;
    let told: String = change.instruction.replace('|', "/").chars().take(60).collect();
    let completed = format!("{first} -> {second} of {of}");
    [change.task.clone(), change.seed.to_string(), completed, told, change.open_second.clone()]
}

/// A difference of shares, in percentage points.
fn points(share: f64) -> String {
    format!("{:+.1} pp", 100.0 * share)
}

fn signed(value: f64) -> String {
    format!("{value:+.2}")
}

fn p(value: f64) -> String {
    if value < 0.001 { "< 0.001".into() } else { format!("= {value:.3}") }
}
