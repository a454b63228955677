//! `sprint eval`: plays a task set and writes the run folder.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use clap::{Args, ValueEnum};
use sha2::{Digest, Sha256};

use super::controlled::ControlledRun;
use super::environment::EnvironmentChoice;
use super::exit_status::ExitStatus;
use super::policies::{Deciding, PolicyChoice};
use super::streams::say;
use super::wish_reader::WishReaderArgs;
use super::{jobs, progress, stop, streams};
use crate::control::{Kind, Progress as Place, RunControl};
use crate::data::json::Document;
use crate::data::{json, taskset};
use crate::domain::TaskSet;
use crate::episode::rollout::EndedBy;
use crate::episode::scenes::Scenes;
use crate::eval::evaluation::{Evaluation, EvaluationProgress};
use crate::eval::options::Options;
use crate::eval::progress_event::ProgressEvent;
use crate::eval::tasks::{remote, scene_folder};
use crate::house::grading::Grading;
use crate::language::count::counted;
use crate::report::summary::RunSummary;
use crate::report::threshold::Threshold;
use crate::run_dir::shard::Shard;
use crate::run_dir::writer::RunWriter;
use crate::run_dir::{default_path, policy_places};

/// Plays a task set and writes a run folder.
#[derive(Args)]
pub(crate) struct Eval {
    /// The task file; with --env it may be left out: the episodes of the seeds 0, 1, ... are played then, as many as --limit says
    /// [default there: 100]
    #[arg(long, value_name = "FILE", required_unless_present = "env")]
    tasks: Option<PathBuf>,
    #[command(flatten)]
    environment: EnvironmentChoice,
    #[command(flatten)]
    policy: PolicyChoice,
    #[command(flatten)]
    reader: WishReaderArgs,
    /// The run folder to write; one that the same run began is continued [default: runs/NAME-TIME]
    #[arg(long, value_name = "RUN")]
    out: Option<PathBuf>,
    /// Threads; the result does not depend on their number [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// How often each task is played, with the seeds 0, 1, ...
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    seeds: u64,
    /// Only the first N tasks
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    limit: Option<u32>,
    /// Print the summary as one JSON object, on the last line; progress, on standard error, is a JSON object a line too
    #[arg(long)]
    json: bool,
    /// Tell the agent all steps instead of the task's instruction
    #[arg(long)]
    step_by_step: bool,
    /// Draw the agent's actions by chance instead of taking the likeliest
    #[arg(long)]
    sample: bool,
    #[command(flatten)]
    deciding: Deciding,
    /// Also play each task told in other words: another task's, none, its own shuffled, and a paraphrase
    #[arg(long)]
    language: bool,
    /// `all`: also play each task from each of its subtasks on; the expert does those before
    #[arg(long, value_name = "all", value_parser = ["all"])]
    from_subtask: Option<String>,
    /// How subtasks are graded: class, or strict as the released code does
    #[arg(long, value_name = "class|strict", default_value_t = Grading::Class)]
    grader: Grading,
    /// Whose word ends an episode before its time: the grader's, as in the paper, or the agent's own. An agent's counts as a
    /// success only where everything that was asked holds then
    #[arg(long, value_enum, default_value = "grader")]
    end: EndName,
    /// Begin an episode that ends with an error anew, at most so often; episodes of an earlier run in --out too
    #[arg(long, value_name = "N", default_value_t = 0)]
    retries: u32,
    /// End an episode with an error when it takes longer, within a step too
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=1_000_000), default_value_t = 3600)]
    timeout: u64,
    /// Play one share of the episodes, into RUN/shards; `slurm` reads which from the environment of an array's job
    #[arg(long, value_name = "I/N|slurm")]
    shard: Option<Shard>,
    /// Exit with 2 when a figure falls short, for example success=0.8 or progress_by_length.3=0.5; may be repeated
    #[arg(long, value_name = "METRIC=X")]
    fail_below: Vec<Threshold>,
}

#[derive(Clone, Copy, ValueEnum)]
enum EndName {
    Agent,
    Grader,
}

impl Eval {
    /// Plays what is not in the run folder yet, and prints the summary.
    ///
    /// # Errors
    /// When the tasks, the policy or the folder cannot be used. An episode's own errors are counted instead.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        let (set, file) = self.task_set()?;
        let scenes = Scenes::of(&file, &set.value);
        let chosen = self.policy.open(self.sample, self.deciding.asked())?;
        let reader = self.reader.open()?;
        let named = (chosen.name.as_str(), chosen.checkpoint_hash.clone());
        let evaluation = Evaluation::prepare_read_by(&set, scenes, self.options(), named, reader.as_deref())
            .with_context(|| format!("{}", file.display()))?
            .reaching(self.environment.reach());
        if let Some((many, why)) = evaluation.unasked() {
            say(&format!("{} read by the program itself: {why}", counted(many, "instruction")));
        }
        let is_remote = evaluation.tasks().iter().any(|task| task.env.is_some());
        if let Some(name) = self.environment.remote().filter(|_| !is_remote) {
            anyhow::bail!("{}: its tasks play in House, not in {name}: leave out --env", file.display());
        }
        // An environment that cannot be reached, or is of no use, is no reason to begin a run. House's own policies fit House.
        if is_remote || self.policy.is_external() {
            evaluation.check_policy(&chosen)?;
        }
        let path = self.folder(&set.value.name, &chosen.name);
        let mut run = RunWriter::open(&path, evaluation.manifest())?;
        policy_places::write(&path, chosen.place().as_slice())?;
        run.write_tasks(&scene_folder::as_seen_from(&set.value, evaluation.tasks(), &file, &path)?)?;
        let stop = stop::on_signals()?;
        let run_control = ControlledRun::listen(Kind::Eval, &path, &stop, evaluation.clock());
        let mut meter = Meter::new(self.json, run_control.control.clone());
        let summary = crate::eval::evaluation::evaluate(&evaluation, &chosen.make, &mut run, &stop, &mut |progress| {
            meter.show(progress)
        });
        // What goes on from here is the same command with this folder.
        let summary = summary.with_context(|| format!("{}: the run is not whole", path.display()))?;
        meter.finish();
        print(&summary, self.json)?;
        say(&format!("wrote {}", path.display()));
        chosen.check_unchanged()?;
        self.status(&summary)
    }

    /// The tasks that are played, and the file that they are from.
    fn task_set(&self) -> anyhow::Result<(Document<TaskSet>, PathBuf)> {
        match (&self.tasks, self.environment.remote()) {
            (Some(file), _) => Ok((taskset::read_told(file)?, file.clone())),
            (None, Some(name)) => {
                let set = remote::set(name, 0, self.limit.unwrap_or(100));
                let digest = json::hex(&Sha256::digest(serde_json::to_vec(&set)?));
                Ok((Document { value: set, digest }, PathBuf::from(name.to_string())))
            }
            (None, None) => anyhow::bail!("House has no tasks of its own: name a file with --tasks"),
        }
    }

    fn options(&self) -> Options {
        Options {
            grading: self.grader,
            end: match self.end {
                EndName::Agent => EndedBy::Agent,
                EndName::Grader => EndedBy::Grader,
            },
            seeds: self.seeds,
            limit: self.limit.map(|limit| limit as usize),
            jobs: jobs::threads(self.jobs),
            step_by_step: self.step_by_step,
            sampling: self.sample,
            deciding: self.deciding.asked(),
            language: self.language,
            every_start: self.from_subtask.is_some(),
            retries: self.retries,
            timeout: Some(Duration::from_secs(self.timeout)),
            shard: self.shard,
        }
    }

    /// The run's folder, or that of its share.
    fn folder(&self, set: &str, policy: &str) -> PathBuf {
        let run = self.out.clone().unwrap_or_else(|| {
            let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
            default_path::default_path(&format!("{set}-{policy}"), now.as_secs(), &|path| path.exists())
        });
        self.shard.map_or_else(|| run.clone(), |shard| run.join(shard.folder()))
    }

    fn status(&self, summary: &RunSummary) -> anyhow::Result<ExitStatus> {
        if summary.partial {
            say("interrupted: the summary is partial; the same command with this folder as --out continues it");
            return Ok(ExitStatus::Interrupted);
        }
        let mut status = if summary.errors == 0 { ExitStatus::Ok } else { ExitStatus::SomeFailed };
        for threshold in &self.fail_below {
            if let Some(measured) = threshold.missed_by(summary)? {
                say(&format!("{threshold} was missed: {measured:.4}"));
                status = ExitStatus::BelowThreshold;
            }
        }
        Ok(status)
    }
}

/// Prints what was measured to standard output: a page, or a JSON object in a line.
pub(crate) fn print(summary: &RunSummary, json: bool) -> anyhow::Result<()> {
    let mut out = streams::out();
    if json {
        writeln!(out, "{}", serde_json::to_string(summary)?)?;
    } else {
        writeln!(out, "{}", summary.markdown())?;
    }
    Ok(out.flush()?)
}

/// Progress on standard error: a display for people, or a JSON object for every episode.
struct Meter {
    display: Option<progress::Progress>,
    started: Instant,
    control: Arc<RunControl>,
}

impl Meter {
    fn new(json: bool, control: Arc<RunControl>) -> Meter {
        Meter { display: (!json).then(progress::Progress::new), started: Instant::now(), control }
    }

    fn show(&mut self, progress: EvaluationProgress) {
        let event = ProgressEvent::Progress { progress, seconds: self.started.elapsed().as_secs_f64() };
        let event = serde_json::to_string(&event).unwrap_or_default();
        let EvaluationProgress { done, of, successes, errors } = progress;
        let message = match errors {
            0 => format!("{successes} succeeded"),
            _ => format!("{successes} succeeded, {errors} errored"),
        };
        let (stage, done, of) = ("episodes", done as u64, of as u64);
        match &mut self.display {
            Some(display) => display.show(stage, done, of, &message),
            None => say(&event),
        }
        self.control.note(Place { stage: stage.into(), done, of: Some(of), message }, Some(event));
    }

    fn finish(&self) {
        if let Some(display) = &self.display {
            display.end();
        }
    }
}
