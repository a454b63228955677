//! `sprint collect`: demonstrations in generated houses, or of given tasks.

use std::path::PathBuf;

use anyhow::ensure;
use clap::Args;

use super::exit_status::ExitStatus;
use super::progress::Progress;
use super::streams::say;
use super::{checkpoint, stop, value_names};
use crate::agent::sentence_encoders;
use crate::data::taskset;
use crate::episode::scenes::Scenes;
use crate::house::expert::TurnTiming;
use crate::language::count::counted;
use crate::nets::device::best_device;
use crate::train::collect::{Collection, DemonstrationSettings, ExpertKind, TaskSource};

/// Collects demonstrations.
#[derive(Args)]
pub(crate) struct Collect {
    /// The dataset folder to write
    out: PathBuf,
    /// Where to collect
    #[arg(long, default_value = "generated", value_parser = ["generated"])]
    scenes: String,
    /// The tasks to demonstrate, each once and in its own words, instead of tasks in generated houses
    #[arg(long, value_name = "TASKS", conflicts_with_all = ["scenes", "episodes", "lengths", "annotations"])]
    tasks: Option<PathBuf>,
    /// How many demonstrations
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,
    /// Drives houses, tasks, words and chance
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Task lengths, drawn uniformly; a length may be listed more than once
    #[arg(long, value_delimiter = ',', default_values_t = [1, 1, 1, 2])]
    lengths: Vec<usize>,
    /// The expert that demonstrates, or says what a learner should have done
    #[arg(long, default_value = ExpertKind::SCANNING, value_parser = value_names::expert())]
    demonstrator: ExpertKind,
    /// The expert turns and acts as early as it may instead of as late, so that a learner need not hit the last moment
    #[arg(long)]
    prompt: bool,
    /// The fraction of steps at which random actions begin, for up to four steps
    #[arg(long, default_value_t = 0.08)]
    noise: f64,
    /// Phrasings of each demonstration
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=100))]
    annotations: u8,
    /// A checkpoint that acts, while the demonstrator only says what it would do: its folder, its name among checkpoints/, or
    /// ORG/NAME[@REVISION] on the Hub
    #[arg(long, value_name = "DIR|NAME")]
    learner: Option<PathBuf>,
}

impl Collect {
    /// Collects.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        ensure!((0.0..=1.0).contains(&self.noise), "--noise is {}, which is not between 0 and 1", self.noise);
        let lengths = self.lengths.iter().all(|length| (1..=16).contains(length));
        ensure!(lengths && !self.lengths.is_empty(), "--lengths must lie between 1 and 16");
        let learner = match self.learner {
            Some(named) => {
                let folder = checkpoint::folder(&named)?;
                let sentences = sentence_encoders::open_for(&folder, best_device())?;
                Some((folder, sentences))
            }
            None => None,
        };
        let tasks = match self.tasks {
            Some(file) => {
                let set = taskset::read(&file)?.value;
                TaskSource::Tasks { scenes: Scenes::of(&file, &set), tasks: set.tasks }
            }
            None => TaskSource::Generated {
                episodes: self.episodes as usize,
                lengths: self.lengths,
                annotations: self.annotations.into(),
            },
        };
        let turn_timing = if self.prompt { TurnTiming::Early } else { TurnTiming::Late };
        let settings = DemonstrationSettings { expert: self.demonstrator, turn_timing, noise: self.noise };
        let collection = Collection { out: self.out, tasks, seed: self.seed, settings, learner };
        let stop = stop::on_signals()?;
        let mut progress = Progress::new();
        let collected = collection.run(&mut progress, &stop)?;
        progress.end();
        let at = collection.out.display();
        say(&format!(
            "{}{} in {at}",
            if collected.stopped { "stopped; the first " } else { "" },
            counted(collected.trajectories, "demonstration")
        ));
        if collected.stopped {
            return Ok(ExitStatus::Interrupted);
        }
        Ok(ExitStatus::Ok)
    }
}
