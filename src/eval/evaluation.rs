//! Evaluation: every task with every seed, on several threads, with the same result for any number of them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;

use super::earlier_episodes::check_earlier;
use super::options::Options;
use super::plan::EvaluationPlan;
use super::read_tasks::read_all;
use super::{worker, worker_pool};
use crate::agent::Observation;
use crate::agent::policy_source::{MakePolicy, PolicySource};
use crate::control::RunningClock;
use crate::data::json::Document;
use crate::domain::{Task, TaskSet};
use crate::env::remote::{RemoteSettings, Sessions};
use crate::episode::instruction_variant;
use crate::episode::record::{Episode, EpisodeKey};
use crate::episode::scenes::Scenes;
use crate::episode::wish::ServedReader;
use crate::house::grading::Grading;
use crate::report::summary::RunSummary;
use crate::report::summary_files;
use crate::run_dir::episode_spec::{EpisodeSpec, own_specs};
use crate::run_dir::manifest::RunManifest;
use crate::run_dir::writer::RunWriter;

/// An evaluation that can start: its tasks fit their scenes. Copies share tasks and scenes.
#[derive(Clone)]
pub struct Evaluation {
    plan: EvaluationPlan,
    manifest: RunManifest,
}

/// How far an evaluation is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
pub struct EvaluationProgress {
    /// Episodes that are over.
    pub(crate) done: usize,
    /// Of how many.
    pub(crate) of: usize,
    /// Of the done ones, successes.
    pub(crate) successes: usize,
    /// Of the done ones, those that ended with an error.
    pub(crate) errors: usize,
}

impl EvaluationProgress {
    fn count(&mut self, episode: &Episode) {
        self.done += 1;
        self.successes += usize::from(episode.success);
        self.errors += usize::from(episode.error.is_some());
    }
}

impl Evaluation {
    /// Checks that every task can start, before anything is written.
    ///
    /// # Errors
    /// Names the task and field that is wrong; the caller names the file.
    pub fn prepare(
        set: &Document<TaskSet>,
        scenes: Scenes,
        options: Options,
        policy: &str,
        checkpoint_hash: Option<String>,
    ) -> anyhow::Result<Evaluation> {
        Evaluation::prepare_read_by(set, scenes, options, (policy, checkpoint_hash), None)
    }

    /// The same with a language model that says what instructions alone ask for.
    ///
    /// # Errors
    /// As before; a model that does not answer is none.
    pub(crate) fn prepare_read_by(
        set: &Document<TaskSet>,
        scenes: Scenes,
        options: Options,
        (policy, checkpoint_hash): (&str, Option<String>),
        reader: Option<&ServedReader>,
    ) -> anyhow::Result<Evaluation> {
        let mut tasks = set.value.tasks.clone();
        tasks.truncate(options.limit.unwrap_or(usize::MAX));
        let scenes_hash = scenes.check(&tasks)?;
        let read = read_all(&mut tasks, &scenes, reader)?;
        check(&tasks, options)?;
        let manifest = RunManifest {
            format_version: RunManifest::FORMAT,
            sprint_version: env!("CARGO_PKG_VERSION").into(),
            task_set: set.value.name.clone(),
            task_set_hash: set.digest.clone(),
            scenes_hash,
            policy: policy.to_owned(),
            checkpoint_hash,
            tasks: tasks.len(),
            seeds: options.seeds,
            grader: options.grading,
            end: options.end,
            step_by_step: options.step_by_step,
            sampling: options.sampling,
            deciding: options.deciding,
            instruction_variants: options.language,
            all_start_subtasks: options.every_start,
            shard: options.shard,
            reader: reader.map(|served| served.name().to_owned()),
        };
        manifest.check()?;
        let plan = EvaluationPlan {
            tasks: tasks.into(),
            scenes: Arc::new(scenes),
            options,
            remote: RemoteSettings::default(),
            read: Arc::new(read),
            clock: Arc::default(),
        };
        Ok(Evaluation { plan, manifest })
    }

    /// The same, with environments in other processes reached like this.
    pub(crate) fn reaching(mut self, remote: RemoteSettings) -> Evaluation {
        self.plan.remote = remote;
        self
    }

    /// Checks that a policy has a use for each environment that is played in, where the first task there begins.
    ///
    /// # Errors
    /// When an environment cannot be reached, or the policy has no use for it.
    pub(crate) fn check_policy(&self, policy: &PolicySource) -> anyhow::Result<()> {
        let made = (policy.make)()?;
        let mut sessions = Sessions::new(self.plan.remote.clone());
        let mut seen = Vec::new();
        for task in self.plan.tasks.iter() {
            if seen.contains(&task.env.as_ref()) {
                continue;
            }
            seen.push(task.env.as_ref());
            let mut environment = worker::environment_of(&self.plan, &mut sessions, 0, task)?;
            made.check_fits(&mut Observation::start(&mut *environment)).with_context(|| policy.name.clone())?;
        }
        Ok(())
    }

    /// What identifies this run.
    pub fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    /// Its time, by which it can be paused.
    pub(crate) fn clock(&self) -> &Arc<RunningClock> {
        &self.plan.clock
    }

    /// The tasks that are played.
    pub fn tasks(&self) -> &[Task] {
        &self.plan.tasks
    }

    /// Instructions alone, which the program had to read in place of a language model: how many, and why the first.
    pub(crate) fn unasked(&self) -> Option<(usize, &str)> {
        let mut all = self.plan.read.values().filter_map(|wish| wish.unasked.as_deref());
        let first = all.next()?;
        Some((1 + all.count(), first))
    }

    /// Where they play.
    pub fn scenes(&self) -> &Scenes {
        &self.plan.scenes
    }

    /// Every episode of the run, or of its share, in order.
    pub(crate) fn all(&self) -> Vec<EpisodeSpec> {
        own_specs(&self.manifest, &self.plan.tasks)
    }

    /// What tells an episode apart from the others.
    pub(crate) fn key(&self, spec: &EpisodeSpec) -> EpisodeKey {
        spec.key(&self.plan.tasks)
    }

    /// Plays these episodes on several threads; `sink` takes each, in their order.
    ///
    /// `stop` ends it early: what is under way is dropped.
    ///
    /// # Errors
    /// When a policy cannot be made, or `sink` fails.
    pub(crate) fn play(
        &self,
        wanted: &[EpisodeSpec],
        make_policy: &Arc<MakePolicy>,
        stop: &Arc<AtomicBool>,
        sink: &mut dyn FnMut(Episode) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        worker_pool::play(&self.plan, wanted, make_policy, stop, sink)
    }
}

/// Checks that the tasks have what the options need.
fn check(tasks: &[Task], options: Options) -> anyhow::Result<()> {
    if options.step_by_step
        && let Some(i) = tasks.iter().position(|task| task.sentences.is_empty())
    {
        anyhow::bail!("tasks[{i}].sentences: missing, so the task {:?} cannot be given step by step", tasks[i].id);
    }
    if let Some(i) = tasks.iter().position(|task| task.env.is_some())
        && options.every_start
    {
        anyhow::bail!("tasks[{i}].env: only the expert of House can lead to a later subtask; leave out --from-subtask");
    }
    if options.grading == Grading::Strict {
        let is_unrecorded = |task: &&Task| task.subtasks.iter().any(|subtask| subtask.literal.is_none());
        let unrecorded: Vec<&Task> = tasks.iter().filter(is_unrecorded).collect();
        if let Some(first) = unrecorded.first() {
            let which = match unrecorded.len() {
                1 => format!("the task {:?} is not", first.id),
                many if many == tasks.len() => format!("none of the {many} is ({:?} is the first)", first.id),
                many => format!("{many} of {} are not ({:?} is the first)", tasks.len(), first.id),
            };
            anyhow::bail!(
                "strict grading needs tasks that were cut from recorded demonstrations (their subtasks[].literal), and \
                 {which}: use --grader class, or tasks of an imported dataset"
            );
        }
    }
    if options.language && !instruction_variant::can_swap(tasks, options.step_by_step) {
        anyhow::bail!("tasks: all have the same instruction, so none can be swapped for another; leave out --language");
    }
    Ok(())
}

/// Runs an evaluation into its folder: the episodes that are not there yet, in the run's order.
///
/// `stop` ends it early: what is under way is dropped, and the summary says that it is partial.
///
/// # Errors
/// When a policy cannot be made or the folder cannot be written to. What goes wrong in an episode is recorded there instead.
pub fn evaluate(
    evaluation: &Evaluation,
    make_policy: &Arc<MakePolicy>,
    folder: &mut RunWriter,
    stop: &Arc<AtomicBool>,
    progress: &mut dyn FnMut(EvaluationProgress),
) -> anyhow::Result<RunSummary> {
    let all = evaluation.all();
    check_earlier(&evaluation.plan, &evaluation.manifest, folder)?;
    let mut episodes: BTreeMap<EpisodeKey, Episode> =
        std::mem::take(&mut folder.earlier).into_iter().map(|episode| (episode.key(), episode)).collect();
    let mut wanted = Vec::new();
    for spec in &all {
        match episodes.get(&evaluation.key(spec)) {
            None => wanted.push(*spec),
            // What failed before is begun anew as often as is asked now.
            Some(found) if found.error.is_some() && found.attempts <= evaluation.plan.options.retries => {
                wanted.push(EpisodeSpec { attempts: found.attempts, ..*spec });
            }
            Some(_) => {}
        }
    }
    let mut state = EvaluationProgress { of: all.len(), ..EvaluationProgress::default() };
    let again: Vec<EpisodeKey> = wanted.iter().map(|spec| evaluation.key(spec)).collect();
    for key in &again {
        episodes.remove(key);
    }
    episodes.values().for_each(|episode| state.count(episode));
    progress(state);
    evaluation.play(&wanted, make_policy, stop, &mut |mut episode| {
        folder.append(&episode)?;
        state.count(&episode);
        progress(state);
        // It is on disk; a night's run need not be in memory too.
        episode.trace = Vec::new();
        episodes.insert(episode.key(), episode);
        Ok(())
    })?;
    finish(&evaluation.manifest, &evaluation.plan.tasks, &all, folder)
}

/// Sums up what a folder holds, and writes the summary into it.
///
/// # Errors
/// When the folder cannot be read or written to.
pub(crate) fn finish(
    manifest: &RunManifest,
    tasks: &[Task],
    all: &[EpisodeSpec],
    folder: &mut RunWriter,
) -> anyhow::Result<RunSummary> {
    let order: Vec<EpisodeKey> = all.iter().map(|spec| spec.key(tasks)).collect();
    let (episodes, hash) = folder.result(&order)?;
    let mut summary = RunSummary::of(manifest, tasks, &episodes, episodes.len() < all.len());
    summary.episodes_hash = hash;
    summary_files::write(&summary, folder.path())?;
    Ok(summary)
}

#[cfg(test)]
pub(crate) mod tests;
