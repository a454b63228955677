//! `sprint labels`: what runs of skills are called, by one source and another.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::exit_status::ExitStatus;
use super::streams;
use crate::report::label_comparison::LabelComparison;

/// Looks at labels.
#[derive(Args)]
pub(crate) struct Labels {
    #[command(subcommand)]
    command: LabelsCommand,
}

#[derive(Subcommand)]
enum LabelsCommand {
    /// Compare two sources of labels: counts over the passages that both labelled, and some side by side
    Compare(LabelsCompare),
}

#[derive(Args)]
struct LabelsCompare {
    /// The dataset folder
    data: PathBuf,
    /// A source of labels: rules, concat, or a model's name
    first: String,
    /// Another source
    second: String,
    /// How many passages to show, chosen by chance
    #[arg(long, value_name = "N", default_value_t = 20)]
    examples: usize,
    /// Drives the choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print the comparison as one JSON object
    #[arg(long)]
    json: bool,
}

impl Labels {
    /// Prints what is asked for.
    ///
    /// # Errors
    /// When the dataset cannot be read, or lacks the labels.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let LabelsCommand::Compare(asked) = self.command;
        let sources = [asked.first.as_str(), asked.second.as_str()];
        let comparison = LabelComparison::of(&asked.data, sources, asked.examples, asked.seed)?;
        let mut out = streams::out();
        if asked.json {
            writeln!(out, "{}", serde_json::to_string(&comparison)?)?;
        } else {
            write!(out, "{}", comparison.markdown())?;
        }
        out.flush()?;
        Ok(ExitStatus::Ok)
    }
}
