//! `sprint collect`: demonstrations in generated houses, or of given tasks.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use anyhow::ensure;
use clap::{Args, ValueEnum};

use super::bar::Bars;
use super::exit_status::ExitStatus;
use super::stop;
use super::streams::say;
use crate::data::taskset;
use crate::episode::scenes::Scenes;
use crate::house::expert::TurnTiming;
use crate::nets::device::best_device;
use crate::nets::embedding_cache::Embedder;
use crate::nets::sentence::default_folder;
use crate::train::collect::{Collection, Demonstrator, Manner, Source};

/// Collects demonstrations.
#[derive(Args)]
pub struct Collect {
    /// The dataset folder to write
    out: PathBuf,
    /// Where to collect
    #[arg(long, default_value = "generated")]
    scenes: Where,
    /// The tasks to demonstrate, each once and told in its own words, instead of tasks in generated houses
    #[arg(long, value_name = "TASKS", conflicts_with_all = ["scenes", "episodes", "lengths", "annotations"])]
    tasks: Option<PathBuf>,
    /// How many demonstrations
    #[arg(long, default_value_t = 1000)]
    episodes: usize,
    /// Drives houses, tasks, words and chance
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Task lengths, drawn uniformly; a length may be listed more than once
    #[arg(long, value_delimiter = ',', default_values_t = [1, 1, 1, 2])]
    lengths: Vec<usize>,
    /// Who demonstrates, or says what a learner should have done
    #[arg(long, value_enum, default_value = "seeker")]
    demonstrator: Who,
    /// Turns and acts as soon as it may, not as late, so that a learner need not hit the last moment
    #[arg(long)]
    prompt: bool,
    /// The share of steps at which chance takes over for up to four steps
    #[arg(long, default_value_t = 0.08)]
    noise: f64,
    /// Phrasings of each demonstration
    #[arg(long, default_value_t = 4)]
    annotations: usize,
    /// A checkpoint that acts, while the demonstrator only says what it would do
    #[arg(long, value_name = "DIR")]
    learner: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Where {
    /// Generated houses
    Generated,
}

#[derive(Clone, Copy, ValueEnum)]
enum Who {
    /// Turns around until it has seen what it goes for
    ScanningExpert,
    /// Goes straight for things, seen or not, as ALFRED's planner did
    Expert,
}

impl Collect {
    /// Collects.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub fn run(self) -> anyhow::Result<ExitStatus> {
        let Where::Generated = self.scenes;
        ensure!((0.0..=1.0).contains(&self.noise), "--noise is {}, which is not a share", self.noise);
        let lengths = self.lengths.iter().all(|length| (1..=16).contains(length));
        ensure!(lengths && !self.lengths.is_empty(), "--lengths must lie between 1 and 16");
        let learner = match self.learner {
            Some(folder) => {
                let embedder = Embedder::open(&default_folder(), best_device())?;
                Some((folder, Arc::new(Mutex::new(embedder))))
            }
            None => None,
        };
        let source = match self.tasks {
            Some(file) => {
                let set = taskset::read(&file)?.value;
                Source::Tasks { scenes: Scenes::of(&file, &set), tasks: set.tasks }
            }
            None => Source::Generated { episodes: self.episodes, lengths: self.lengths, annotations: self.annotations },
        };
        let demonstrator = match self.demonstrator {
            Who::ScanningExpert => Demonstrator::ScanningExpert,
            Who::Expert => Demonstrator::Expert,
        };
        let pace = if self.prompt { TurnTiming::Early } else { TurnTiming::Late };
        let manner = Manner { demonstrator, pace, noise: self.noise };
        let collection = Collection { out: self.out, source, seed: self.seed, manner, learner };
        let stop = stop::on_signals()?;
        let mut bars = Bars::new();
        let collected = collection.run(&mut bars, &stop)?;
        bars.end();
        let at = collection.out.display();
        say(&format!(
            "{}{} demonstrations in {at}",
            if collected.stopped { "stopped; the first " } else { "" },
            collected.trajectories
        ));
        if collected.stopped {
            return Ok(ExitStatus::Interrupted);
        }
        Ok(ExitStatus::Ok)
    }
}
