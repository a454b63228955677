//! Episodes under way, and the watch over them: whoever thinks too long can be left alone without losing what it did.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::evaluation::Evaluation;
use crate::episode::record::Episode;
use crate::episode::{failure, instruction_variant};
use crate::run_dir::episode_spec::Booking;

/// An episode under way, as far as it is recorded.
#[derive(Clone, Debug)]
pub(crate) struct Underway {
    /// Its position among what is wanted.
    pub at: usize,
    /// Which one it is.
    pub booking: Booking,
    /// Since when it is played.
    pub began: Instant,
    /// What was recorded so far.
    pub episode: Episode,
}

impl Underway {
    /// Before the first step.
    pub fn new(evaluation: &Evaluation, at: usize, booking: Booking) -> Underway {
        let task = &evaluation.tasks[booking.task];
        let chance = crate::run_dir::episode_spec::policy_seed(booking.task, booking.seed);
        let step_by_step = evaluation.options.step_by_step;
        let episode = Episode {
            task: task.id.clone(),
            seed: booking.seed,
            wording: booking.wording,
            from: booking.from,
            instruction: instruction_variant::say(
                &evaluation.tasks,
                booking.task,
                booking.wording,
                step_by_step,
                chance,
            ),
            of: (task.subtasks.len() as u32).saturating_sub(booking.from),
            attempts: booking.attempts + 1,
            ..Episode::default()
        };
        Underway { at, booking, began: Instant::now(), episode }
    }

    /// Ends it with an error, unless it has one.
    pub fn fail(&mut self, problem: &str) {
        self.episode.error.get_or_insert_with(|| problem.to_owned());
    }

    /// The booking of another attempt, where an error is to be tried again.
    pub fn again(&self, evaluation: &Evaluation) -> Option<Booking> {
        let tried = self.episode.attempts;
        let again = self.episode.error.is_some() && tried <= evaluation.options.retries;
        again.then_some(Booking { attempts: tried, ..self.booking })
    }

    /// The record of what it came to.
    pub fn close(mut self, evaluation: &Evaluation) -> Episode {
        let episode = &mut self.episode;
        let own = &episode.trace[(episode.prefix as usize).min(episode.trace.len())..];
        episode.steps = own.len() as u32;
        episode.completed = own.iter().filter(|step| step.subtask.is_some()).count() as u32;
        episode.success = episode.error.is_none() && episode.completed == episode.of;
        if !episode.success && episode.error.is_none() {
            let task = &evaluation.tasks[self.booking.task];
            // An episode whose failure cannot be told apart, be it by a panic, keeps all else.
            let class = guarded(|| {
                let setting = evaluation.scenes.setting(task)?;
                Ok(failure::classify(task, evaluation.options.grading, &setting, &episode.trace))
            });
            episode.failure = class.ok();
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

/// What is under way at a table, seat by seat. The table writes it, the thread that waits for the table reads it.
#[derive(Debug)]
pub(crate) struct Watch {
    state: Mutex<State>,
}

#[derive(Debug)]
pub(crate) struct State {
    /// Seat by seat.
    pub seats: Vec<Option<Underway>>,
    /// Nobody waits for this table any more: it must record nothing.
    pub is_left: bool,
}

impl Watch {
    /// Over a table with empty seats.
    pub fn new(seats: usize) -> Watch {
        Watch { state: Mutex::new(State { seats: vec![None; seats], is_left: false }) }
    }

    /// What is under way now. A table that panicked while it wrote leaves its last whole record.
    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a table's episodes away from it when one has taken so much longer than `limit` that the table must hang within
    /// one step: between two steps it looks at the time itself.
    pub fn leave_if_hanging(&self, limit: Duration) -> Option<Vec<Underway>> {
        let patience = limit + (limit / 10).max(Duration::from_secs(1));
        let mut state = self.lock();
        if state.is_left || !state.seats.iter().flatten().any(|underway| underway.began.elapsed() >= patience) {
            return None;
        }
        state.is_left = true;
        Some(state.seats.iter_mut().filter_map(Option::take).collect())
    }
}
