//! `sprint export`: a recorded episode as a picture, a film, a strip, a transcript, or a page.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::environment::EnvironmentChoice;
use super::exit_status::ExitStatus;
use super::{recorded::Reference, streams};
use crate::episode::frames::FrameSequence;
use crate::report::export;

/// Which episode, and into which files.
#[derive(Args)]
pub(crate) struct Export {
    /// The run folder, with the episode (its number from 1, or its task's id) and, for a .png, the step
    #[arg(value_name = "RUN[#EPISODE[:STEP]]")]
    episode: String,
    /// The files to write; the ending says what: .gif, .png, .strip.png, .txt, .html
    #[arg(value_name = "FILE", required = true)]
    out: Vec<PathBuf>,
    /// The task file that the run was made from, where the folder does not hold it
    #[arg(long, value_name = "FILE")]
    tasks: Option<PathBuf>,
    #[command(flatten)]
    environment: EnvironmentChoice,
}

impl Export {
    /// Writes the files.
    ///
    /// # Errors
    /// When the episode cannot be read, or a file cannot be written.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let (reference, recorded) = Reference::find(&self.episode, self.tasks.as_deref())?;
        let episode = &recorded.episodes[reference.episode];
        let task = recorded.task(episode)?;
        let recording = match &task.env {
            Some(_) => FrameSequence::remote(task, episode, self.environment.reach())?,
            None => FrameSequence::of(&recorded.setting(episode)?.2, task, episode)?,
        };
        let mut out = streams::out();
        for path in &self.out {
            let size = export::write(&recording, reference.step.unwrap_or(0), path)?;
            writeln!(out, "{}: {:.1} kB", path.display(), size as f64 / 1000.0)?;
        }
        Ok(ExitStatus::Ok)
    }
}
