//! `sprint merge`: joins the shares of a run.

use std::path::PathBuf;

use clap::Args;

use super::exit_status::ExitStatus;
use crate::eval::merge;

/// Joins the shares that `sprint eval --shard` wrote into one run.
#[derive(Args)]
pub(crate) struct MergeArgs {
    /// The run folder; its shares lie in RUN/shards
    run: PathBuf,
    /// The shares, where they lie elsewhere
    shares: Vec<PathBuf>,
    /// Print the summary as one JSON object
    #[arg(long)]
    json: bool,
}

impl MergeArgs {
    /// Joins the shares, and prints the summary of the whole.
    ///
    /// # Errors
    /// When a share is missing or not complete, or they are not of one run.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let shares = if self.shares.is_empty() { merge::shares_in(&self.run)? } else { self.shares };
        let summary = merge::merge(&shares, &self.run)?;
        super::eval::print(&summary, self.json)?;
        Ok(if summary.errors == 0 { ExitStatus::Ok } else { ExitStatus::SomeFailed })
    }
}
