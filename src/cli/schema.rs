//! `sprint schema`: the JSON Schemas.

use std::io::Write;

use clap::Args;

use super::{Ending, streams};
use crate::eval::schemas;

/// Prints a JSON Schema.
#[derive(Args)]
pub struct Schema {
    /// Whose: tasks, manifest, episode, summary, comparison or progress
    #[arg(value_name = "NAME", value_parser = schemas::NAMES)]
    name: String,
}

impl Schema {
    /// Prints it.
    ///
    /// # Errors
    /// When standard output is closed.
    pub fn run(self) -> anyhow::Result<Ending> {
        let mut out = streams::out();
        if let Some(schema) = schemas::schema(&self.name) {
            writeln!(out, "{}", serde_json::to_string_pretty(&schema)?)?;
        }
        out.flush()?;
        Ok(Ending::Ok)
    }
}
