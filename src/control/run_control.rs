//! Steering of a run that goes on by itself: an evaluation, a training.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::message::{Kind, Order, Progress, State, Status};
use super::running_clock::RunningClock;
use super::server::Controlled;
use super::tail::Tail;

/// What a run shares with those who steer it.
pub(crate) struct RunControl {
    kind: Kind,
    what: String,
    stop: Arc<AtomicBool>,
    clock: Arc<RunningClock>,
    progress: Mutex<Progress>,
    tail: Tail,
}

impl RunControl {
    /// Of a run that writes `what`, ends when `stop` is set, and stands still with `clock`.
    pub(crate) fn new(kind: Kind, what: String, stop: Arc<AtomicBool>, clock: Arc<RunningClock>) -> Arc<RunControl> {
        Arc::new(RunControl { kind, what, stop, clock, progress: Mutex::default(), tail: Tail::default() })
    }

    /// It came that far; the event in words for whoever listens, where it is one.
    pub(crate) fn note(&self, progress: Progress, event: Option<String>) {
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = progress;
        if let Some(event) = event {
            self.tail.say(event);
        }
    }

    /// Waits where it is paused.
    pub(crate) fn wait(&self) {
        self.clock.wait(&self.stop);
    }

    fn state(&self) -> State {
        match (self.stop.load(Ordering::Relaxed), self.clock.is_paused()) {
            (true, _) => State::Stopping,
            (false, true) => State::Paused,
            (false, false) => State::Running,
        }
    }
}

impl Controlled for RunControl {
    fn status(&self) -> Status {
        Status {
            pid: std::process::id(),
            kind: self.kind,
            what: self.what.clone(),
            state: self.state(),
            progress: self.progress.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            instruction: None,
        }
    }

    fn obey(&self, order: Order) -> Result<String, String> {
        let (done, event) = match order {
            Order::Pause => {
                self.clock.pause();
                ("paused after the step under way", "paused")
            }
            Order::Resume => {
                self.clock.resume();
                ("goes on", "resumed")
            }
            Order::Stop => {
                self.stop.store(true, Ordering::Relaxed);
                ("saves what is done and ends; the same command goes on from there", "stopping")
            }
            Order::Instruct(_) => {
                let told = match self.kind {
                    Kind::Eval => "an evaluation's instructions are its tasks': start another with other tasks",
                    _ => "a training takes no instructions; instruct an explorer",
                };
                return Err(told.into());
            }
        };
        self.tail.say(format!("{{\"event\":\"{event}\"}}"));
        Ok(done.into())
    }

    fn tail(&self) -> &Tail {
        &self.tail
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_is_paused_resumed_and_stopped_but_not_instructed() {
        let (stop, clock) = (Arc::new(AtomicBool::new(false)), Arc::new(RunningClock::default()));
        let control = RunControl::new(Kind::Eval, "runs/a".into(), stop.clone(), clock.clone());
        control.obey(Order::Pause).unwrap();
        assert_eq!((control.status().state, clock.is_paused()), (State::Paused, true));
        control.obey(Order::Resume).unwrap();
        assert_eq!(control.status().state, State::Running);
        assert!(control.obey(Order::Instruct("Go.".into())).unwrap_err().contains("its tasks'"));
        control.obey(Order::Stop).unwrap();
        assert_eq!((control.status().state, stop.load(Ordering::Relaxed)), (State::Stopping, true));
    }
}
