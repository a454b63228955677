//! Episodes under way, and the watch over them: whoever thinks too long can be left alone without losing what it did.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::plan::EvaluationPlan;
use crate::episode::failure::Failure;
use crate::episode::record::{Episode, TraceStep};
use crate::episode::wish::{Wish, WishVerdict};
use crate::episode::{diagnosis, instruction_variant};
use crate::run_dir::episode_spec::EpisodeSpec;

/// An episode under way, as far as it is recorded.
#[derive(Clone, Debug)]
pub(crate) struct InFlight {
    /// Its position among what is wanted.
    pub(crate) at: usize,
    /// Which one it is.
    pub(crate) spec: EpisodeSpec,
    /// Since when it is played, by the run's clock.
    pub(crate) began: Duration,
    /// What was recorded so far.
    pub(crate) episode: Episode,
}

impl InFlight {
    /// Before the first step.
    pub(crate) fn new(evaluation: &EvaluationPlan, at: usize, spec: EpisodeSpec) -> InFlight {
        let task = &evaluation.tasks[spec.task];
        let chance = crate::run_dir::episode_spec::policy_seed(spec.task, spec.seed);
        let step_by_step = evaluation.options.step_by_step;
        let episode = Episode {
            task: task.id.clone(),
            seed: spec.seed,
            variant: spec.variant,
            start_subtask: spec.start_subtask,
            instruction: instruction_variant::instruction_for(
                &evaluation.tasks,
                spec.task,
                spec.variant,
                step_by_step,
                chance,
            ),
            of: (task.subtasks.len() as u32).saturating_sub(spec.start_subtask),
            attempts: spec.attempts + 1,
            ..Episode::default()
        };
        InFlight { at, spec, began: evaluation.clock.now(), episode }
    }

    /// Ends it with an error, unless it has one.
    pub(crate) fn fail(&mut self, problem: &str) {
        self.episode.error.get_or_insert_with(|| problem.to_owned());
    }

    /// The spec of another attempt, where an error is to be tried again.
    pub(crate) fn again(&self, evaluation: &EvaluationPlan) -> Option<EpisodeSpec> {
        let tried = self.episode.attempts;
        let again = self.episode.error.is_some() && tried <= evaluation.options.retries;
        again.then_some(EpisodeSpec { attempts: tried, ..self.spec })
    }

    /// The record of what it came to.
    pub(crate) fn close(mut self, evaluation: &EvaluationPlan) -> Episode {
        let episode = &mut self.episode;
        let own = &episode.trace[(episode.prefix_steps as usize).min(episode.trace.len())..];
        episode.steps = own.len() as u32;
        episode.completed = TraceStep::completed(own);
        let end = evaluation.options.end;
        let is_remote = evaluation.tasks[self.spec.task].env.is_some();
        if is_remote {
            episode.of = episode.of.max(episode.completed);
            let mut rewards = own.iter().filter_map(|step| step.own.as_ref()?.reward).peekable();
            episode.earned = rewards.peek().is_some().then(|| rewards.sum());
        }
        episode.success = episode.is_success(end);
        if !episode.success && episode.error.is_none() && !is_remote {
            let task = &evaluation.tasks[self.spec.task];
            // An episode whose failure cannot be told apart, be it by a panic, keeps all else.
            let class = guarded(|| {
                let setting = evaluation.scenes.setting(task)?;
                diagnosis::classify(task, evaluation.options.grading, &setting, &episode.trace)
            });
            episode.failure = match (episode.completed == episode.of, episode.agent_end) {
                _ if end.is_grader() => class.ok(),
                (true, Some(_)) => Some(Failure::Undone),
                (true, None) => Some(Failure::NeverStopped),
                (false, Some(_)) => Some(Failure::StoppedEarly),
                (false, None) => class.ok(),
            };
        }
        if let Some(wish) = evaluation.read.get(&self.spec.task) {
            let verdict = match (episode.success, episode.error.is_some()) {
                (true, _) => Some(WishVerdict::Done),
                // Where the agent ended it, time was left.
                (false, false) if episode.agent_end.is_none() => Some(WishVerdict::OutOfTime),
                (false, _) => None,
            };
            let agent_done = episode.agent_end.map(|_| episode.trace.len() as u32);
            let (steps, completed, failure) = (episode.steps, episode.completed, episode.failure);
            let instruction = episode.instruction.clone();
            episode.wishes = vec![Wish { instruction, steps, completed, agent_done, verdict, failure, ..wish.clone() }];
        }
        self.episode
    }
}

/// Runs something; what went wrong, a panic included, in words.
pub(crate) fn guarded<T>(run: impl FnOnce() -> anyhow::Result<T>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(format!("{error:#}")),
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().copied();
            let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
            Err(format!("panicked: {}", text.unwrap_or("without a message")))
        }
    }
}

/// What is under way at a worker, slot by slot. The worker writes it, the thread that waits for the worker reads it.
#[derive(Debug)]
pub(crate) struct Watchdog {
    state: Mutex<WatchdogState>,
}

#[derive(Debug)]
pub(crate) struct WatchdogState {
    /// Slot by slot.
    pub(crate) slots: Vec<Option<InFlight>>,
    /// Nobody waits for this worker any more: it must record nothing.
    pub(crate) is_abandoned: bool,
}

impl Watchdog {
    /// For a worker with empty slots.
    pub(crate) fn new(slots: usize) -> Watchdog {
        Watchdog { state: Mutex::new(WatchdogState { slots: vec![None; slots], is_abandoned: false }) }
    }

    /// What is under way now. A worker that panicked while it wrote leaves its last whole record.
    pub(crate) fn lock(&self) -> MutexGuard<'_, WatchdogState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a worker's episodes away from it when one has taken so much longer than `limit` that the worker must hang within
    /// one step: between two steps it looks at the time itself.
    pub(crate) fn abandon_if_hanging(&self, now: Duration, limit: Duration) -> Option<Vec<InFlight>> {
        let patience = limit + (limit / 10).max(Duration::from_secs(1));
        let mut state = self.lock();
        if state.is_abandoned
            || !state.slots.iter().flatten().any(|in_flight| now.saturating_sub(in_flight.began) >= patience)
        {
            return None;
        }
        state.is_abandoned = true;
        Some(state.slots.iter_mut().filter_map(Option::take).collect())
    }
}
