//! `sprint report`: the plots and the page of a run.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;

use super::exit_status::ExitStatus;
use super::streams::say;
use crate::data::{atomic_file, json};
use crate::report::charts::progress_by_length;
use crate::report::html;
use crate::report::summary::RunSummary;
use crate::run_dir::layout::{MANIFEST, SUMMARY};
use crate::run_dir::reader::RecordedRun;

/// Draws a run: its plots and its page.
#[derive(Args)]
pub(crate) struct ReportArgs {
    /// A run folder: its page is written to report.html there
    folder: PathBuf,
    /// The most frames of an episode on the page
    #[arg(long, value_name = "N", default_value_t = 8)]
    frames: usize,
    /// Where to write instead
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

impl ReportArgs {
    /// Writes the page and the plot of a run.
    ///
    /// # Errors
    /// When the folder holds none, or cannot be written to.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let out = self.out.as_ref().unwrap_or(&self.folder);
        if self.folder.join(MANIFEST).exists() {
            let run = RecordedRun::open(&self.folder, None)?;
            let path = self.folder.join(SUMMARY);
            let summary = json::read::<RunSummary>(&path, RunSummary::FORMAT)
                .context("the same eval command writes the summary")?
                .value;
            let page = out.join("report.html");
            atomic_file::write(&page, html::run_page(&run, &summary, self.frames)?.as_bytes())?;
            progress_by_length::draw(&[&summary]).write(out, progress_by_length::FILE_STEM)?;
            say(&format!("wrote {}", page.display()));
        } else {
            bail!(
                "{} holds no run (manifest.json is missing); the curves of a training are drawn by `sprint plot`",
                self.folder.display()
            );
        }
        Ok(ExitStatus::Ok)
    }
}
