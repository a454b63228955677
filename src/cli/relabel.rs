//! `sprint relabel`: what runs of skills are called.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::exit_status::ExitStatus;
use super::progress::Progress;
use super::stop;
use super::streams::say;
use crate::language::count::counted;
use crate::language::passage::{Concatenation, Summarizer};
use crate::language::rules::Rules;
use crate::train::relabel::relabel;

/// Labels runs of skills.
#[derive(Args)]
pub(crate) struct Relabel {
    /// The dataset folder
    data: PathBuf,
    /// Who writes the labels
    #[arg(long)]
    with: With,
}

#[derive(Clone, Copy, ValueEnum)]
enum With {
    /// A short summary, from the skills and the annotator's own words
    Rules,
    /// The annotator's sentences one after the other
    Concat,
}

impl Relabel {
    /// Writes the labels that are missing in the dataset's labels.jsonl.
    ///
    /// # Errors
    /// When the dataset cannot be read or its folder not be written to.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let summarizer: &dyn Summarizer = match self.with {
            With::Rules => &Rules,
            With::Concat => &Concatenation,
        };
        let stop = stop::on_signals()?;
        let mut progress = Progress::new();
        let found = relabel(&self.data, summarizer, &mut progress, &stop)?;
        progress.end();
        if found.stopped {
            say("stopped; the same command goes on from here");
            return Ok(ExitStatus::Interrupted);
        }
        let (source, version) = (summarizer.source(), summarizer.version());
        say(&format!(
            "{}: {}, {} labelled before, {} written by {source} {version}",
            self.data.join("labels.jsonl").display(),
            counted(found.spans, "span"),
            found.known,
            counted(found.asked, "text")
        ));
        Ok(ExitStatus::Ok)
    }
}
