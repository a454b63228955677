//! `sprint schema`: the JSON Schemas.

use std::io::Write;

use clap::Args;

use super::exit_status::ExitStatus;
use super::streams;
use crate::eval::schemas;

/// Prints a JSON Schema.
#[derive(Args)]
pub(crate) struct Schema {
    /// Whose: tasks, manifest, episode, summary, comparison, progress, policies (where a run's were), or policy (the
    /// description beside an exported one)
    #[arg(value_name = "NAME", value_parser = schemas::NAMES)]
    name: String,
}

impl Schema {
    /// Prints the schema of that name.
    ///
    /// # Errors
    /// When standard output is closed.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let mut out = streams::out();
        if let Some(schema) = schemas::schema(&self.name) {
            writeln!(out, "{}", serde_json::to_string_pretty(&schema)?)?;
        }
        out.flush()?;
        Ok(ExitStatus::Ok)
    }
}
