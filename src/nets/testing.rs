//! For tests only: libtorch's random numbers are one stream for the whole process.

use std::sync::{Mutex, MutexGuard, PoisonError};

static CHANCE: Mutex<()> = Mutex::new(());

/// Holds libtorch's random numbers: tests that seed and draw from them run one after another. They compute with one thread: what
/// they compute is small, and on a busy machine threads that wait for each other take ten times as long.
pub(crate) fn chance() -> MutexGuard<'static, ()> {
    tch::set_num_threads(1);
    CHANCE.lock().unwrap_or_else(PoisonError::into_inner)
}
