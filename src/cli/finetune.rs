//! `sprint finetune`: an agent goes on learning on tasks of its own.

use std::io::Write;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use clap::Args;

use super::exit_status::ExitStatus;
use super::progress::Progress;
use super::streams::say;
use super::{checkpoint, stop, streams};
use crate::agent::learned::SharedEmbedder;
use crate::data::taskset;
use crate::house::grading::Grading;
use crate::nets::device::best_device;
use crate::nets::embedding_cache::Embedder;
use crate::nets::sentence::default_folder;
use crate::train::finetune::Finetuning;

/// Finetunes an agent on tasks, one training a task, by online IQL.
#[derive(Args)]
pub(crate) struct Finetune {
    /// The agent that is finetuned, of the presets sprint, iql-primitive or am, or of l-bc with --critic-from: a folder, or a name in checkpoints/
    #[arg(long, value_name = "DIR")]
    checkpoint: PathBuf,
    /// Take this checkpoint's critic: for l-bc one of iql-primitive, pretrained on the same data with the same visual encoder
    #[arg(long, value_name = "DIR")]
    critic_from: Option<PathBuf>,
    /// The task file: a training for each of its tasks, or with #N for that one alone, by its number from 1 or its id
    #[arg(long, value_name = "FILE[#N]")]
    tasks: String,
    /// The folder to write: a checkpoint a task, curves of the means, a summary
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Hyper-parameters that are to be otherwise than in assets/finetune.toml
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Environment steps of each task's training after the initial rollouts, instead of 10000 or the file's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Drives exploration and replay, instead of 1 or the file's
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// How subtasks are graded and rewarded: class, or strict as the released code does
    #[arg(long, value_name = "class|strict", default_value_t = Grading::Class)]
    grader: Grading,
    /// Tasks that are trained on side by side; the result does not depend on it
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: u16,
    /// Go on with the finetuning that was begun there
    #[arg(long)]
    resume: bool,
    /// Print the summary as one JSON object instead of a table
    #[arg(long)]
    json: bool,
    /// The sentence encoder's folder [default: all-MiniLM-L6-v2, which `make setup` fetched]
    #[arg(long, value_name = "DIR")]
    encoder: Option<PathBuf>,
}

impl Finetune {
    /// Finetunes, and prints the summary.
    ///
    /// # Errors
    /// When checkpoint, tasks or folder cannot be used.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let (tasks, only) = taskset::split_reference(&self.tasks);
        let device = best_device();
        let folder = self.encoder.unwrap_or_else(default_folder);
        let embedder: SharedEmbedder = Arc::new(Mutex::new(Embedder::open(&folder, device)?));
        let finetuning = Finetuning {
            checkpoint: checkpoint::folder(&self.checkpoint)?,
            critic_from: self.critic_from.as_deref().map(checkpoint::folder).transpose()?,
            tasks,
            only: only.map(str::to_owned),
            grading: self.grader,
            out: self.out,
            config: self.config,
            steps: self.steps,
            seed: self.seed,
            jobs: usize::from(self.jobs),
            resume: self.resume,
            embedder,
            device,
        };
        let stop = stop::on_signals()?;
        let mut progress = Progress::new();
        let summary = finetuning.run(&mut progress, &stop);
        progress.end();
        let Some(summary) = summary? else {
            say("stopped; --resume goes on from here");
            return Ok(ExitStatus::Interrupted);
        };
        let mut out = streams::out();
        match self.json {
            true => writeln!(out, "{}", serde_json::to_string(&summary)?)?,
            false => write!(out, "{}", summary.markdown())?,
        }
        out.flush()?;
        say(&format!("wrote {}", finetuning.out.display()));
        Ok(ExitStatus::Ok)
    }
}
