//! `sprint plot`: draws the curves of trainings.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::exit_status::ExitStatus;
use super::streams;
use crate::data::atomic_file;
use crate::report::charts::training_curves;

/// Draws the curves of trainings.
#[derive(Args)]
pub(crate) struct PlotCurves {
    /// Checkpoint folders that trainings wrote
    #[arg(required = true, num_args = 1..)]
    runs: Vec<PathBuf>,
    /// Where to draw; .svg or .png says how, and another name gets both
    #[arg(long, value_name = "FILE", default_value = "curves")]
    out: PathBuf,
    /// Only scalars whose names contain one of these words
    #[arg(long, value_name = "WORD", value_delimiter = ',')]
    only: Vec<String>,
}

impl PlotCurves {
    /// Draws, and prints the files' names.
    ///
    /// # Errors
    /// When a training's progress cannot be read, or the picture not be written.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let read = |folder: &PathBuf| Ok((folder.display().to_string(), training_curves::read(folder)?));
        let trainings = self.runs.iter().map(read).collect::<anyhow::Result<Vec<_>>>()?;
        let plot = training_curves::draw(&trainings, &self.only)?;
        let extension = self.out.extension().and_then(std::ffi::OsStr::to_str).unwrap_or_default().to_lowercase();
        let files = match extension.as_str() {
            "svg" | "png" => vec![self.out.clone()],
            _ => ["svg", "png"].map(|kind| PathBuf::from(format!("{}.{kind}", self.out.display()))).to_vec(),
        };
        let mut out = streams::out();
        for file in files {
            let is_svg = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"));
            let bytes = if is_svg { plot.svg().into_bytes() } else { plot.png()? };
            atomic_file::write(&file, &bytes)?;
            writeln!(out, "{}", file.display())?;
        }
        Ok(ExitStatus::Ok)
    }
}
