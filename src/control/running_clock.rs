//! Time that stands still while a run is paused: what is paused for an hour has not taken longer.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A run's own time, and whether it goes on.
#[derive(Debug)]
pub(crate) struct RunningClock {
    began: Instant,
    pauses: Mutex<Pauses>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Pauses {
    /// Since when it is paused.
    since: Option<Instant>,
    /// How long it was paused before.
    before: Duration,
}

impl Default for RunningClock {
    fn default() -> RunningClock {
        RunningClock { began: Instant::now(), pauses: Mutex::default(), changed: Condvar::new() }
    }
}

/// How often one who waits looks whether he is to stop.
const GLANCE: Duration = Duration::from_millis(100);

impl RunningClock {
    /// The time that the run took until now, without its pauses.
    pub(crate) fn now(&self) -> Duration {
        let pauses = self.pauses();
        pauses.since.unwrap_or_else(Instant::now).duration_since(self.began).saturating_sub(pauses.before)
    }

    /// Stops the clock; whoever asks [`RunningClock::wait`] waits.
    pub(crate) fn pause(&self) {
        self.pauses().since.get_or_insert_with(Instant::now);
    }

    /// Lets it go on.
    pub(crate) fn resume(&self) {
        let mut pauses = self.pauses();
        if let Some(since) = pauses.since.take() {
            pauses.before += since.elapsed();
        }
        drop(pauses);
        self.changed.notify_all();
    }

    /// Whether it stands still.
    pub(crate) fn is_paused(&self) -> bool {
        self.pauses().since.is_some()
    }

    /// Waits until the run goes on, or is to stop.
    pub(crate) fn wait(&self, stop: &AtomicBool) {
        let mut pauses = self.pauses();
        while pauses.since.is_some() && !stop.load(Ordering::Relaxed) {
            let waited = self.changed.wait_timeout(pauses, GLANCE).unwrap_or_else(PoisonError::into_inner);
            pauses = waited.0;
        }
    }

    fn pauses(&self) -> MutexGuard<'_, Pauses> {
        self.pauses.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn the_clock_stands_still_while_it_is_paused_and_goes_on_from_there() {
        let clock = RunningClock::default();
        clock.pause();
        let stood = clock.now();
        std::thread::sleep(Duration::from_millis(20));
        assert_eq!(clock.now(), stood);
        clock.resume();
        assert!(clock.now() >= stood && clock.now() + Duration::from_millis(20) <= clock.began.elapsed());
    }

    #[test]
    fn one_who_waits_goes_on_with_the_run_or_stops() {
        let (clock, stop) = (Arc::new(RunningClock::default()), Arc::new(AtomicBool::new(false)));
        for ends in [true, false] {
            clock.pause();
            let waits = {
                let (clock, stop) = (clock.clone(), stop.clone());
                std::thread::spawn(move || clock.wait(&stop))
            };
            if ends {
                stop.store(true, Ordering::Relaxed)
            } else {
                clock.resume()
            }
            waits.join().unwrap();
            stop.store(false, Ordering::Relaxed);
        }
        clock.wait(&stop);
    }
}
