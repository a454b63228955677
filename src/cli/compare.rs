//! `sprint compare`: two or more runs of the same tasks, paired.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::exit_status::ExitStatus;
use super::streams;
use super::streams::say;
use crate::data::json;
use crate::language::count::counted;
use crate::report::compare::Comparison;
use crate::report::threshold::Threshold;
use crate::run_dir::reader::RecordedRun;

/// Compares runs, episode by episode.
#[derive(Args)]
pub(crate) struct CompareArgs {
    /// The run folders; the others are compared with the first. RUN,RUN,...: the same method's, trained with several seeds
    #[arg(value_name = "RUN", required = true, num_args = 2..)]
    runs: Vec<PathBuf>,
    /// Print the comparison as one JSON object
    #[arg(long)]
    json: bool,
    /// Write the comparison to a file too, as JSON
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Exit with 2 when a figure of the last run falls short, for example success=0.8; may be repeated
    #[arg(long, value_name = "METRIC=X")]
    fail_below: Vec<Threshold>,
    /// Exit with 2 when a run fails in more episodes that the first solved
    #[arg(long, value_name = "N")]
    max_regressions: Option<usize>,
}

impl CompareArgs {
    /// Prints the comparison, and holds it against the thresholds.
    ///
    /// # Errors
    /// When a folder holds no run, or two have no episode in common.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let runs: Vec<RecordedRun> = self.runs.iter().map(|paths| open(paths)).collect::<anyhow::Result<_>>()?;
        let (comparison, summaries) = Comparison::of(&runs)?;
        if let Some(path) = &self.out {
            json::write_pretty(path, &comparison)?;
        }
        let mut out = streams::out();
        if self.json {
            writeln!(out, "{}", serde_json::to_string(&comparison)?)?;
        } else {
            write!(out, "{}", comparison.markdown())?;
        }
        out.flush()?;
        let mut status = ExitStatus::Ok;
        if let Some(most) = self.max_regressions.filter(|&most| comparison.regressions() > most) {
            say(&format!("{}, at most {most} allowed", counted(comparison.regressions(), "regression")));
            status = ExitStatus::BelowThreshold;
        }
        let last = summaries.last();
        for (threshold, summary) in self.fail_below.iter().filter_map(|threshold| Some((threshold, last?))) {
            if let Some(measured) = threshold.missed_by(summary)? {
                say(&format!("{threshold} was missed: {measured:.4}"));
                status = ExitStatus::BelowThreshold;
            }
        }
        Ok(status)
    }
}

/// A run, or several with commas between as one.
fn open(paths: &Path) -> anyhow::Result<RecordedRun> {
    match paths.to_str() {
        // A folder may have a comma in its own name.
        Some(text) if text.contains(',') && !paths.exists() => {
            let parts = text.split(',').map(|path| RecordedRun::open_evaluated(Path::new(path)));
            RecordedRun::joined(parts.collect::<anyhow::Result<_>>()?)
        }
        _ => RecordedRun::open_evaluated(paths),
    }
}
