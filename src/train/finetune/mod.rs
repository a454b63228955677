//! Finetuning (the paper's section 5.1.2): a pretrained agent goes on learning by online IQL on one task at a time, from newly
//! collected rollouts alone.

mod config;
mod origin;
mod out_folder;
mod replay;
mod rollouts;
mod spec;
mod summary;
mod task_training;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context;

use self::config::FinetuneConfig;
use self::origin::Origin;
use self::out_folder::OutFolder;
use self::rollouts::Start;
pub(crate) use self::spec::Finetuning;
pub(crate) use self::summary::FinetuneSummary;
use self::summary::{Finished, Heading};
use self::task_training::{STAGE, TaskTraining};
use super::metrics::{JsonLinesLogger, ProgressLogger, Scalars};
use super::tensorboard::TensorBoard;
use crate::data::taskset;
use crate::data::{folder, json};
use crate::domain::{Task, TaskSet};
use crate::episode::scenes::Scenes;
use crate::eval::evaluation::Evaluation;
use crate::eval::options::Options;
use crate::nets::device;

/// The tasks to train on, each with its number from 1 in the file.
struct Tasks {
    name: String,
    digest: String,
    scenes_hash: String,
    scenes: Scenes,
    numbered: Vec<(usize, Task)>,
}

/// What the trainings of all tasks share.
struct Trainings<'a> {
    origin: &'a Origin<'a>,
    config: &'a FinetuneConfig,
    tasks: &'a Tasks,
    trained: &'a [Finished<'a>],
    identity: &'a BTreeMap<String, String>,
}

impl Finetuning {
    /// Trains on every task, and writes a checkpoint for each, the curves of their means and a summary, which is returned; nothing
    /// when it was stopped.
    ///
    /// # Errors
    /// When the checkpoint cannot be finetuned, a task not be played, or the folder holds something else, all of which is found
    /// before anything is written; when the folder cannot be written to; when a loss is not a number.
    pub(crate) fn run(
        &self,
        logger: &mut (dyn ProgressLogger + Send),
        stop: &Arc<AtomicBool>,
    ) -> anyhow::Result<Option<FinetuneSummary>> {
        // More threads than one would make sums depend on how many there are, and tasks get in each other's way.
        device::set_threads(1);
        let folder = OutFolder { out: &self.out, resume: self.resume };
        folder.check()?;
        let origin = Origin::read(self)?;
        let config = self.config(&origin)?;
        let tasks = self.tasks()?;
        self.check_goals(&origin, &tasks)?;
        let identity = self.identity(&origin, &tasks);
        let _lock = folder.prepare(&config.text()?, &identity)?;

        let trained: Vec<Finished<'_>> = tasks
            .numbered
            .iter()
            .map(|(number, task)| {
                let whole = folder.of_task(*number, task);
                let within = whole.strip_prefix(&self.out).map(PathBuf::from).unwrap_or(whole);
                (*number, task, within)
            })
            .collect();
        let trainings =
            Trainings { origin: &origin, config: &config, tasks: &tasks, trained: &trained, identity: &identity };
        if !self.train(&trainings, logger, stop)? {
            return Ok(None);
        }
        let folders: Vec<PathBuf> = trained.iter().map(|(_, _, folder)| folder.clone()).collect();
        summary::write_means(&self.out, &folders, config.steps)?;
        let method = origin.config.method.as_deref().unwrap_or("bc");
        let heading = Heading { method, checkpoint: &self.checkpoint, task_set: &tasks.name, steps: config.steps };
        let summary = FinetuneSummary::of(&self.out, &heading, &trained)?;
        summary.write(&self.out)?;
        Ok(Some(summary))
    }

    fn config(&self, origin: &Origin<'_>) -> anyhow::Result<FinetuneConfig> {
        let config = FinetuneConfig::read(self.config.as_deref(), &origin.pretraining)?;
        let config = FinetuneConfig {
            steps: self.steps.unwrap_or(config.steps),
            seed: self.seed.unwrap_or(config.seed),
            ..config
        };
        config.check()?;
        Ok(config)
    }

    fn tasks(&self) -> anyhow::Result<Tasks> {
        let mut set: json::Document<TaskSet> = taskset::read_told(&self.tasks)?;
        let scenes = Scenes::of(&self.tasks, &set.value);
        let name = || self.tasks.display().to_string();
        let numbers: Vec<usize> = match &self.only {
            None => (0..set.value.tasks.len()).collect(),
            Some(wanted) => vec![taskset::pick(&set.value, wanted).with_context(name)?],
        };
        set.value.tasks = numbers.iter().map(|&at| set.value.tasks[at].clone()).collect();
        let evaluation =
            Evaluation::prepare(&set, scenes, Options::plain(self.grading), "agent", None).with_context(name)?;
        Ok(Tasks {
            name: set.value.name,
            digest: set.digest,
            scenes_hash: evaluation.manifest().scenes_hash.clone(),
            scenes: evaluation.scenes().clone(),
            numbered: numbers.iter().map(|at| at + 1).zip(evaluation.tasks().iter().cloned()).collect(),
        })
    }

    /// An agent that is shown its goal can only be shown what the expert reaches: that is found out before the first task is
    /// begun.
    fn check_goals(&self, origin: &Origin<'_>, tasks: &Tasks) -> anyhow::Result<()> {
        if origin.config.policy.goal_channels.is_none() {
            return Ok(());
        }
        let mut explorer = origin.explorer(0.0)?;
        for (number, task) in &tasks.numbered {
            let start = self.start(tasks, task)?;
            let shown = start.conditioning(&mut explorer);
            drop(shown.with_context(|| format!("{}#{number} (task {:?})", self.tasks.display(), task.id))?);
        }
        Ok(())
    }

    fn start(&self, tasks: &Tasks, task: &Task) -> anyhow::Result<Start> {
        let setting = tasks.scenes.setting(task)?;
        Ok(Start { task: Arc::new(task.clone()), setting, grading: self.grading })
    }

    /// What the finetuning, and so each saved state, belongs to.
    fn identity(&self, origin: &Origin<'_>, tasks: &Tasks) -> BTreeMap<String, String> {
        let mut identity: BTreeMap<String, String> = [
            ("checkpoint", origin.checkpoint_hash.clone()),
            ("task_set", tasks.digest.clone()),
            ("scenes", tasks.scenes_hash.clone()),
            ("grading", self.grading.to_string()),
            ("tasks", tasks.numbered.iter().map(|(number, _)| number.to_string()).collect::<Vec<_>>().join(",")),
        ]
        .map(|(name, value)| (name.to_string(), value))
        .into();
        identity.extend(origin.critic_hash.iter().map(|hash| ("critic".to_string(), hash.clone())));
        identity
    }

    /// Trains on the tasks, some side by side; false when it was stopped.
    fn train(
        &self,
        trainings: &Trainings<'_>,
        logger: &mut (dyn ProgressLogger + Send),
        stop: &Arc<AtomicBool>,
    ) -> anyhow::Result<bool> {
        let &Trainings { origin, config, tasks, trained, identity } = trainings;
        let progress = Overall { logger: Mutex::new((logger, vec![0; trained.len()])), steps: config.steps };
        let next = AtomicUsize::new(0);
        let failed = AtomicBool::new(false);
        let work = || -> anyhow::Result<bool> {
            device::set_threads(1);
            loop {
                let place = next.fetch_add(1, Ordering::Relaxed);
                let Some((_, task, within)) = trained.get(place) else { return Ok(true) };
                if stop.load(Ordering::Relaxed) || failed.load(Ordering::Relaxed) {
                    return Ok(false);
                }
                let (start, folder) = (self.start(tasks, task)?, self.out.join(within));
                let training = folder.join("training");
                folder::make(&training).with_context(|| training.display().to_string())?;
                let mut shown = progress.of_task(place);
                let mut kept = JsonLinesLogger::open(&training.join("progress.jsonl"), &mut shown)?;
                let mut kept = TensorBoard::open(&training, &mut kept)?;
                let training = TaskTraining { origin, config, start, folder: &folder, identity };
                if !training.run(&mut kept, stop).with_context(|| format!("task {:?}", task.id))? {
                    return Ok(false);
                }
            }
        };
        // One that fails ends the others at their next task.
        let work = || work().inspect_err(|_| failed.store(true, Ordering::Relaxed));
        let jobs = self.jobs.clamp(1, trained.len().max(1));
        let ended: Vec<anyhow::Result<bool>> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap_or_else(|_| panicked())).collect()
        });
        let ended = ended.into_iter().collect::<anyhow::Result<Vec<bool>>>()?;
        Ok(ended.into_iter().all(|whole| whole))
    }
}

fn panicked() -> anyhow::Result<bool> {
    anyhow::bail!("a task's training ended with a panic; --resume goes on from its last saved state")
}

/// The progress of all tasks together.
struct Overall<'a> {
    /// Whoever shows it, and the steps of each task.
    logger: Mutex<(&'a mut (dyn ProgressLogger + Send), Vec<u64>)>,
    /// Steps of each task's training.
    steps: u64,
}

/// The progress of one of them.
struct OfTask<'a, 'b> {
    overall: &'a Overall<'b>,
    place: usize,
}

impl<'b> Overall<'b> {
    fn of_task(&self, place: usize) -> OfTask<'_, 'b> {
        OfTask { overall: self, place }
    }
}

impl ProgressLogger for OfTask<'_, '_> {
    fn log(&mut self, scalars: &Scalars) -> anyhow::Result<()> {
        let mut guard = self.overall.logger.lock().unwrap_or_else(PoisonError::into_inner);
        let (logger, steps) = &mut *guard;
        steps[self.place] = scalars.step;
        let mut shown = Scalars::new(STAGE, steps.iter().sum(), self.overall.steps * steps.len() as u64);
        for name in ["return", "rollout_return", "updates"] {
            if let Some(&value) = scalars.values.get(name) {
                shown.set(name, value);
            }
        }
        if !shown.values.is_empty() && steps.len() > 1 {
            shown.set("task", self.place as f64 + 1.0);
        }
        logger.log(&shown)
    }
}
