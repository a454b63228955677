//! Runs compared with a first one, as a page and as a file.

use serde::{Deserialize, Serialize};

use super::finished::FinishedRun;
use super::page::{between, percent, table};
use super::paired::{Change, Difference, Paired};
use super::report::Summary;
use super::stats::Interval;

/// What a comparison found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// Version of this format.
    pub format_version: u32,
    /// The runs as they stand, in the order given.
    pub runs: Vec<Standing>,
    /// Every further run against the first.
    pub pairs: Vec<Paired>,
}

/// A run's own figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Standing {
    /// Its folder.
    pub run: String,
    /// Its task set.
    pub task_set: String,
    /// Who acted.
    pub policy: String,
    /// Episodes in the tasks' own words from their starts.
    pub episodes: usize,
    /// Episodes that ended with an error.
    pub errors: usize,
    /// The share of successes.
    pub success: f64,
    /// Its 95 % interval.
    pub success_interval: Interval,
    /// Mean completed subtasks.
    pub completed_subtasks: f64,
    /// Mean progress.
    pub progress: f64,
}

impl Comparison {
    /// The format version this program writes.
    pub const FORMAT: u32 = 2;

    /// Compares every further run with the first; with it comes each run's summary.
    ///
    /// # Errors
    /// When there are fewer than two, or two have no episode in common.
    pub fn of(runs: &[FinishedRun]) -> anyhow::Result<(Comparison, Vec<Summary>)> {
        let [first, others @ ..] = runs else { anyhow::bail!("name the runs to compare") };
        anyhow::ensure!(!others.is_empty(), "name a second run to compare with {}", first.path.display());
        let summary = |run: &FinishedRun| {
            let partial = run.episodes.len() < run.bookings().len();
            Summary::of(&run.manifest, &run.set.tasks, &run.episodes, partial)
        };
        let summaries: Vec<Summary> = runs.iter().map(summary).collect();
        let standing = |(run, summary): (&FinishedRun, &Summary)| Standing {
            run: run.path.display().to_string(),
            task_set: summary.task_set.clone(),
            policy: summary.policy.clone(),
            episodes: summary.episodes,
            errors: summary.errors,
            success: summary.success,
            success_interval: summary.success_interval,
            completed_subtasks: summary.completed_subtasks.mean,
            progress: summary.progress.mean,
        };
        let comparison = Comparison {
            format_version: Comparison::FORMAT,
            runs: runs.iter().zip(&summaries).map(standing).collect(),
            pairs: others.iter().map(|other| Paired::of(first, other)).collect::<anyhow::Result<_>>()?,
        };
        Ok((comparison, summaries))
    }

    /// The most episodes in which a run fell behind the first.
    pub fn regressions(&self) -> usize {
        self.pairs.iter().map(|pair| pair.regressions.len()).max().unwrap_or(0)
    }

    /// The page that people read.
    pub fn markdown(&self) -> String {
        let rows = self.runs.iter().map(|run| {
            let (episodes, errors) = (run.episodes.to_string(), run.errors.to_string());
            let (success, interval) = (percent(run.success), between(run.success_interval));
            let completed = format!("{:.2}", run.completed_subtasks);
            [run.run.clone(), run.policy.clone(), episodes, errors, success, interval, completed, percent(run.progress)]
        });
        let head = ["run", "policy", "episodes", "errors", "success", "95 % interval", "completed", "progress"];
        let mut parts = vec![table(head, rows)];
        if self.pairs.len() > 1 {
            let first = &self.pairs[0].first;
            let rows = self.pairs.iter().map(|pair| {
                let [low, high] = pair.success.interval.map(points);
                let (fell, rose) = (pair.regressions.len().to_string(), pair.fixes.len().to_string());
                let difference = points(pair.success.difference);
                [
                    pair.second.clone(),
                    pair.pairs.to_string(),
                    difference,
                    format!("{low} to {high}"),
                    p(pair.mcnemar_p),
                    fell,
                    rose,
                ]
            });
            let against = format!("against {first}");
            let head = [against.as_str(), "pairs", "success", "95 % interval", "McNemar p", "regressions", "fixes"];
            parts.push(table(head, rows));
        }
        parts.extend(self.pairs.iter().map(Paired::markdown));
        if let Some(pair) = self.pairs.first() {
            parts.push(format!(
                "Methods: rates by Wilson's score, by tasks where they were played with several seeds; {}.\n",
                pair.methods
            ));
        }
        parts.join("\n")
    }
}

impl Paired {
    fn markdown(&self) -> String {
        let row = |name: &str, figure: Difference, show: fn(f64) -> String, change: fn(f64) -> String| {
            let [low, high] = figure.interval.map(change);
            let (first, second) = (show(figure.first), show(figure.second));
            [name.to_owned(), first, second, change(figure.difference), format!("{low} to {high}")]
        };
        let number = |value: f64| format!("{value:.2}");
        let signed = |value: f64| format!("{value:+.2}");
        let rows = [
            row("success", self.success, percent, points),
            row("completed subtasks", self.completed_subtasks, number, signed),
            row("progress", self.progress, percent, points),
        ];
        let lost = match (self.unpaired, self.other_starts) {
            (0, _) => String::new(),
            (n, 0) => format!(" {n} episodes have no counterpart and are left out."),
            (n, m) => format!(" {n} episodes have no counterpart and are left out, {m} of them for another start."),
        };
        let mut text = format!(
            "## {} against {}\n\n{} pairs of episodes (same task, seed and start).{lost}\n\n{}\n",
            self.second,
            self.first,
            self.pairs,
            table(["measure", "first", "second", "difference", "95 % interval"], rows)
        );
        text += &format!(
            "McNemar: p {} (tasks solved more often in the first: {}, in the second: {}).\n",
            p(self.mcnemar_p),
            self.leaning[0],
            self.leaning[1]
        );
        for (title, changes) in [("Regressions", &self.regressions), ("Fixes", &self.fixes)] {
            if !changes.is_empty() {
                text += &format!(
                    "\n### {title}\n\n{}",
                    table(["task", "seed", "completed", "told", "open"], changes.iter().map(change_row))
                );
            }
        }
        text
    }
}

fn change_row(change: &Change) -> [String; 5] {
    let [first, second, of] = change.completed;
    let told: String = change.instruction.replace('|', "/").chars().take(60).collect();
    let completed = format!("{first} -> {second} of {of}");
    [change.task.clone(), change.seed.to_string(), completed, told, change.open_second.clone()]
}

/// A difference of shares, in percentage points.
fn points(share: f64) -> String {
    format!("{:+.1} pp", 100.0 * share)
}

fn p(value: f64) -> String {
    if value < 0.001 { "< 0.001".into() } else { format!("= {value:.3}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::paired::tests::run;

    #[test]
    fn three_runs_make_a_table_and_a_chapter_each() {
        let runs = [run("a", &[true, true, false]), run("b", &[true, false, false]), run("c", &[true, true, true])];
        let (comparison, summaries) = Comparison::of(&runs).unwrap();
        assert_eq!((comparison.pairs.len(), summaries.len(), comparison.regressions()), (2, 3, 1));
        let page = comparison.markdown();
        for part in
            ["| against a ", "## b against a", "## c against a", "### Regressions", "### Fixes", "sprint open b#2"]
        {
            assert!(page.contains(part), "{part} in {page}");
        }
        assert!(page.contains("-33.3 pp") && page.contains("bootstrap over tasks"), "{page}");
        assert!(Comparison::of(&runs[..1]).is_err());
    }
}
