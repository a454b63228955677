//! `sprint verify`: plays a run's episodes again and says whether they come out the same.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::environment::EnvironmentChoice;
use super::exit_status::ExitStatus;
use super::progress::Progress;
use super::recorded_policy::RecordedPolicy;
use super::streams::say;
use super::{jobs, streams};
use crate::episode::record::Author;
use crate::eval::verify::{Difference, Mismatch, verify};
use crate::language::count::counted;
use crate::run_dir::reader::RecordedRun;

/// Which run.
#[derive(Args)]
pub(crate) struct Verify {
    /// The run folder
    run: PathBuf,
    /// The task file that the run was made from, where the folder does not hold it
    #[arg(long, value_name = "FILE")]
    tasks: Option<PathBuf>,
    #[command(flatten)]
    policy: RecordedPolicy,
    /// Threads; the verdict does not depend on their number [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    #[command(flatten)]
    environment: EnvironmentChoice,
    /// Print the verdict as JSON
    #[arg(long)]
    json: bool,
}

impl Verify {
    /// Verifies the run; the exit code tells whether it came out the same.
    ///
    /// # Errors
    /// When the run or its tasks cannot be read.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let run = RecordedRun::open(&self.run, self.tasks.as_deref())?;
        self.policy.check(&run.manifest)?;
        let checkpoint = self.policy.checkpoint()?;
        let mut find = |author: &Author| self.policy.find(&run, author, checkpoint.as_deref(), &say);
        let (mut progress, total) = (Progress::new(), run.episodes.len() as u64);
        let (threads, reach) = (jobs::threads(self.jobs), self.environment.reach());
        let verdict =
            verify(&run, &mut find, threads, &reach, &mut |done| progress.show("verifying", done as u64, total, ""))?;
        progress.end();
        let mut out = streams::out();
        if self.json {
            writeln!(out, "{}", serde_json::to_string(&verdict)?)?;
        } else {
            let (steps, choices) = (verdict.steps, verdict.choices);
            let (episodes, steps) = (counted(verdict.episodes, "episode"), counted(steps, "step"));
            writeln!(out, "{episodes}, {steps} the same, {choices} of them chosen again")?;
            for policy in &verdict.missing {
                writeln!(out, "{policy:?} is not at hand: only what its actions came to was compared")?;
            }
            for d in &verdict.differences {
                let Difference { episode, task, mismatch } = d;
                let Mismatch { step, what, recorded, found } = mismatch;
                writeln!(out, "episode {episode} ({task}), step {step}: {what} was {recorded}, is {found}")?;
            }
            if let Some(told) = verdict.summarised.filter(|&told| told != verdict.plain) {
                writeln!(out, "episodes: the summary counts {told}, there are {}", verdict.plain)?;
            }
            writeln!(out, "{}", if verdict.is_equal() { "equal" } else { "different" })?;
        }
        Ok(if verdict.is_equal() { ExitStatus::Ok } else { ExitStatus::SomeFailed })
    }
}
