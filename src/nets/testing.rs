//! For tests only: libtorch's random numbers are one stream for the whole process.

use std::sync::{Mutex, MutexGuard, PoisonError};

static CHANCE: Mutex<()> = Mutex::new(());

/// Holds libtorch's random numbers: tests that seed and draw from them run one after another.
pub fn chance() -> MutexGuard<'static, ()> {
    // Small tensors are slower on several threads, and on a busy machine far slower.
    tch::set_num_threads(1);
    CHANCE.lock().unwrap_or_else(PoisonError::into_inner)
}
