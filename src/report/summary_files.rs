//! A run's summary in every form, as it lies in the run's folder.

use std::path::Path;

use super::charts::progress_by_length;
use super::summary::RunSummary;
use crate::data::{atomic_file, json};
use crate::run_dir::layout::SUMMARY;

/// Writes the summary as JSON, Markdown and CSV, and its plot, each atomically.
///
/// # Errors
/// When the folder cannot be written to.
pub(crate) fn write(summary: &RunSummary, folder: &Path) -> anyhow::Result<()> {
    atomic_file::write(&folder.join("summary.md"), summary.markdown().as_bytes())?;
    atomic_file::write(&folder.join("summary.csv"), &summary.csv()?)?;
    progress_by_length::draw(&[summary]).write(folder, progress_by_length::FILE_STEM)?;
    json::write_pretty(&folder.join(SUMMARY), summary)
}
