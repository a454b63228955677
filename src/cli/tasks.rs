//! `sprint tasks`: samples, checks and shows task sets.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, ensure};
use clap::{Args, Subcommand};

use super::environment::EnvironmentChoice;
use super::exit_status::ExitStatus;
use super::progress::Counter;
use super::{jobs, streams, value_names};
use crate::agent::policy_source::PolicySource;
use crate::data::{Dataset, folder, taskset};
use crate::domain::{Room, Task};
use crate::env::Environment;
use crate::env::remote::{RemoteEnvironment, Sessions};
use crate::episode::instruction_variant::task_instruction;
use crate::episode::scenes::Scenes;
use crate::eval::evaluation::Evaluation;
use crate::eval::options::Options;
use crate::eval::read_tasks::read_instruction;
use crate::eval::tasks::check;
use crate::eval::tasks::remote;
use crate::eval::tasks::sample;
use crate::eval::tasks::sample::{Phrasing, SampleSpec};
use crate::house::grading::{Grading, describe};
use crate::language::count::counted;

/// Samples, checks and shows task sets.
#[derive(Args)]
pub(crate) struct Tasks {
    #[command(subcommand)]
    what: TasksCommand,
}

#[derive(Subcommand)]
enum TasksCommand {
    /// Write a task set from generated houses or a dataset's demonstrations
    Sample(SampleArgs),
    /// Check that a task set can be played: it parses, its scenes exist, and the expert solves every task
    Check(CheckArgs),
    /// Show a task in words, or list a set's tasks
    Show(ShowArgs),
}

/// Writes a task set.
#[derive(Args)]
struct SampleArgs {
    /// The file to write
    out: PathBuf,
    /// Where the tasks play: `generated` houses, or the folder of a dataset
    #[arg(long, value_name = "generated|DATA", required_unless_present = "env", conflicts_with = "env")]
    scenes: Option<PathBuf>,
    #[command(flatten)]
    environment: EnvironmentChoice,
    /// Subtasks of each task; of several lengths (1,2,3 or 1-5) there are as many tasks each, as far as there are any
    #[arg(long, value_name = "N|N,N|N-N", default_value = "1")]
    length: TaskLengths,
    /// Tasks
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    count: u32,
    /// The same seed gives the same set
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// The kinds of rooms to take [default: all]
    #[arg(long, value_parser = value_names::room(), value_delimiter = ',', value_name = "ROOM,...")]
    rooms: Vec<Room>,
    /// Only these scenes of a dataset [default: all]
    #[arg(long, value_delimiter = ',', value_name = "SCENE,...")]
    only_scenes: Vec<String>,
    /// Whose words tell the agent what to do, in tasks from a dataset
    #[arg(long, value_parser = value_names::phrasing(), default_value = Phrasing::GRAMMAR)]
    phrasing: Phrasing,
    /// Only demonstrations of this split of a dataset
    #[arg(long, value_name = "NAME")]
    split: Option<String>,
    /// Take whole demonstrations alone, and keep these wholes from every later training on the dataset, as EVAL_CHAIN's are
    #[arg(long)]
    withhold: bool,
    /// Replace a file that is there
    #[arg(long)]
    force: bool,
}

/// Lengths of tasks, as ranges or listed.
#[derive(Clone)]
pub(super) struct TaskLengths(pub(super) Vec<usize>);

impl std::str::FromStr for TaskLengths {
    type Err = String;

    fn from_str(text: &str) -> Result<TaskLengths, String> {
        let number = |text: &str| match text.trim().parse::<usize>() {
            Ok(length) if (1..=50).contains(&length) => Ok(length),
            _ => Err(format!("{text:?} is not a number of subtasks, 1 to 50")),
        };
        let mut lengths = Vec::new();
        for part in text.split(',') {
            match part.split_once('-') {
                Some((first, last)) => lengths.extend(number(first)?..=number(last)?),
                None => lengths.push(number(part)?),
            }
        }
        lengths.sort_unstable();
        lengths.dedup();
        if lengths.is_empty() { Err(format!("{text:?} names no length")) } else { Ok(TaskLengths(lengths)) }
    }
}

/// Checks a task set.
#[derive(Args)]
struct CheckArgs {
    /// The task file
    file: PathBuf,
    /// Threads [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

/// Shows a task.
#[derive(Args)]
struct ShowArgs {
    /// The task file, with the task's number from 1 or its id: FILE#N; all tasks in a line each without
    #[arg(value_name = "FILE[#N]")]
    task: String,
}

impl Tasks {
    /// Samples, checks or shows.
    ///
    /// # Errors
    /// When a file cannot be used; names it.
    pub(crate) fn run(self) -> anyhow::Result<ExitStatus> {
        match self.what {
            TasksCommand::Sample(sample) => sample.run(),
            TasksCommand::Check(check) => check.run(),
            TasksCommand::Show(show) => show.run(),
        }
    }
}

impl SampleArgs {
    fn run(self) -> anyhow::Result<ExitStatus> {
        ensure!(self.force || !self.out.exists(), "{} exists; --force replaces it", self.out.display());
        let Some(scenes) = &self.scenes else { return self.remote() };
        let rooms = match self.rooms.is_empty() {
            true => Room::ALL.to_vec(),
            false => self.rooms.clone(),
        };
        let name = self.out.file_stem().map_or_else(|| "tasks".into(), |stem| stem.to_string_lossy().into_owned());
        let lengths = self.length.0.clone();
        let spec = SampleSpec {
            name,
            length: lengths[0],
            count: self.count as usize,
            seed: self.seed,
            rooms,
            only_scenes: self.only_scenes.clone(),
            wholes: self.withhold,
        };
        let set = if scenes == Path::new("generated") {
            ensure!(
                spec.only_scenes.is_empty(),
                "--only-scenes names scenes of a dataset, and generated houses have none"
            );
            ensure!(
                !self.withhold,
                "--withhold keeps demonstrations of a dataset from training, and generated houses have none"
            );
            let counter = Counter::new("sampling", u64::from(self.count));
            let set = sample::balanced(&spec, &lengths, &|spec| sample::sample_generated(spec, &|| counter.add(1)));
            counter.end();
            set?
        } else {
            let dataset = Dataset::open(scenes)?;
            let folder = self.out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            folder::make(folder).with_context(|| format!("cannot make {}", folder.display()))?;
            let split = self.split.as_deref();
            let set = sample::balanced(&spec, &lengths, &|spec| {
                sample::sample_dataset(spec, &dataset, split, self.phrasing, folder)
            })?;
            if self.withhold {
                let sources = set.tasks.iter().filter_map(|task| task.source.as_ref());
                dataset.withhold(&sources.map(|(demonstration, _)| demonstration.as_str()).collect())?;
            }
            set
        };
        taskset::write(&self.out, &set)?;
        say_how_told(&set.tasks);
        Ok(ExitStatus::Ok)
    }
}

impl SampleArgs {
    /// Writes the episodes of seeds of an environment in another process, which must be there.
    fn remote(&self) -> anyhow::Result<ExitStatus> {
        let name = self.environment.remote().context("House's tasks need --scenes: generated, or a dataset")?;
        let session = Sessions::new(self.environment.reach()).get(0, name)?;
        let start = |seed| anyhow::Ok(RemoteEnvironment::begin(session.clone(), seed)?.fingerprint());
        let (first, again) = (start(self.seed)?, start(self.seed)?);
        if session.capabilities.seeds == Some(false) || first != again {
            streams::say(&format!("{name} begins otherwise each time: its seeds name no episodes"));
        }
        let mut set = remote::set(name, self.seed, self.count);
        if let Some(stem) = self.out.file_stem() {
            set.name = stem.to_string_lossy().into_owned();
        }
        taskset::write(&self.out, &set)?;
        Ok(ExitStatus::Ok)
    }
}

impl CheckArgs {
    fn run(self) -> anyhow::Result<ExitStatus> {
        let mistakes = check::mistakes(&self.file)?;
        let mut out = streams::out();
        for mistake in &mistakes {
            writeln!(out, "{}:{mistake}", self.file.display())?;
        }
        check::none(&mistakes, &self.file)?;
        let mut set = taskset::read_told(&self.file)?;
        let others = set.value.tasks.iter().filter(|task| task.env.is_some()).count();
        if others > 0 {
            writeln!(
                out,
                "{}: {} in other environments, which say themselves what is asked",
                self.file.display(),
                counted(others, "task")
            )?;
            set.value.tasks.retain(|task| task.env.is_none());
            if set.value.tasks.is_empty() {
                return Ok(ExitStatus::Ok);
            }
        }
        let scenes = Scenes::of(&self.file, &set.value);
        let options = Options { jobs: jobs::threads(self.jobs), ..Options::plain(Grading::Class) };
        let evaluation = Evaluation::prepare(&set, scenes, options, "expert", None)
            .with_context(|| self.file.display().to_string())?;
        let mut unsolved = 0;
        evaluation.play(
            &evaluation.all(),
            &PolicySource::expert().make,
            &Arc::new(AtomicBool::new(false)),
            &mut |episode| {
                if !episode.success {
                    unsolved += 1;
                    let why =
                        episode.error.unwrap_or_else(|| format!("not done after {}", counted(episode.steps, "step")));
                    let (done, of) = (episode.completed, episode.of);
                    writeln!(
                        out,
                        "{}: the expert completes {done} of {}: {why}",
                        episode.task,
                        counted(of, "subtask")
                    )?;
                }
                Ok(())
            },
        )?;
        let count = set.value.tasks.len();
        say_how_told(&set.value.tasks);
        let (file, tasks) = (self.file.display(), counted(count, "task"));
        writeln!(out, "{file}: {tasks}, {} solved by the expert", count - unsolved)?;
        Ok(if unsolved == 0 { ExitStatus::Ok } else { ExitStatus::SomeFailed })
    }
}

impl ShowArgs {
    fn run(self) -> anyhow::Result<ExitStatus> {
        let (file, wanted) = taskset::split_reference(&self.task);
        let set = taskset::read_told(&file)?.value;
        let mut out = streams::out();
        match wanted {
            None => {
                for (number, task) in (1..).zip(&set.tasks) {
                    let asked = match task.remote_episode() {
                        Some((env, seed)) if task.instruction.is_empty() => format!("what {env} asks with seed {seed}"),
                        _ => task_instruction(task, false),
                    };
                    writeln!(out, "{number:>4}  {asked}  [{}]", task.id)?;
                }
            }
            Some(wanted) => {
                let at = taskset::pick(&set, wanted).with_context(|| file.display().to_string())?;
                show(&mut out, &set.tasks[at], &Scenes::of(&file, &set)).with_context(|| self.task.clone())?;
            }
        }
        Ok(ExitStatus::Ok)
    }
}

/// Says how many instructions are joined sentences: nobody put those runs of steps in words as wholes.
fn say_how_told(tasks: &[Task]) {
    let joined = tasks.iter().filter(|task| task.is_joined()).count();
    if joined > 0 {
        let all = counted(tasks.len(), "task");
        streams::say(&format!("the instructions of {joined} of {all} are their steps' sentences, one after the other"));
    }
}

/// Prints a task in words.
fn show(out: &mut impl Write, task: &Task, scenes: &Scenes) -> anyhow::Result<()> {
    if let Some((env, seed)) = task.remote_episode() {
        writeln!(out, "task         {}", task.id)?;
        writeln!(out, "environment  {env}, seed {seed}")?;
        let asked = if task.instruction.is_empty() {
            "what the environment asks".into()
        } else {
            task_instruction(task, false)
        };
        writeln!(out, "instruction  {asked}")?;
        writeln!(out, "steps        the episode ends after {} at the latest", task.horizon)?;
        return Ok(());
    }
    let setting = scenes.setting(task)?;
    let (scene, world) = (&setting.scene, &setting.world);
    writeln!(out, "task         {}", task.id)?;
    writeln!(out, "instruction  {}", task_instruction(task, false))?;
    writeln!(out, "scene        {} ({})", scene.name, scene.room.spoken())?;
    let pose = world.agent;
    let (x, z) = (f64::from(pose.cell.x) / 4.0, f64::from(pose.cell.z) / 4.0);
    let heading = format!("{:?}", pose.heading).to_lowercase();
    writeln!(out, "start        x {x} m, z {z} m, facing {heading}, looking down {} degrees", pose.horizon)?;
    let held = world.held.and_then(|held| world.object(held)).map_or("nothing", |object| object.class.spoken());
    writeln!(out, "in the hand  {held}")?;
    let expert = match task.expert_steps {
        0 => "an unknown number".to_string(),
        steps => steps.to_string(),
    };
    writeln!(out, "steps        the expert takes {expert}, the episode ends after {}", task.horizon)?;
    if let Some((trajectory, first)) = &task.source {
        writeln!(out, "cut from     {trajectory}, from skill {}", first + 1)?;
    }
    for (i, (subtask, number)) in task.subtasks.iter().zip(1..).enumerate() {
        let sentence = task.sentences.get(i).map(|sentence| format!("   \"{sentence}\"")).unwrap_or_default();
        writeln!(out, "subtask {number:<4} {}{sentence}", describe(&task.roles, subtask))?;
    }
    if task.subtasks.is_empty() {
        match read_instruction(task, &setting, None) {
            Ok(wish) => {
                for (number, words) in (1..).zip(wish.subtasks_in_words()) {
                    writeln!(out, "subtask {number:<4} {words}   (as the instruction is read)")?;
                }
            }
            Err(problem) => writeln!(out, "subtasks     {problem}")?,
        }
    }
    Ok(())
}
