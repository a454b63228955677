//! `sprint schema`: the JSON Schemas.

use std::io::Write;

use clap::Args;

use super::{Ending, streams};
use crate::data::schema;

/// Prints a JSON Schema.
#[derive(Args)]
pub struct Schema {
    /// Whose: tasks, manifest, episode, summary, comparison or progress
    #[arg(value_name = "NAME", value_parser = schema::SCHEMAS.map(|(name, _)| name))]
    name: String,
}

impl Schema {
    /// Prints it.
    ///
    /// # Errors
    /// When standard output is closed.
    pub fn run(self) -> anyhow::Result<Ending> {
        let mut out = streams::out();
        write!(out, "{}", schema::text(&self.name).unwrap_or_default())?;
        out.flush()?;
        Ok(Ending::Ok)
    }
}
