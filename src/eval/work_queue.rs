//! The episodes that wait to be played.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::run_dir::episode_spec::EpisodeSpec;

/// What is wanted, by slot.
pub(crate) struct WorkQueue {
    by_slot: Vec<Vec<(usize, EpisodeSpec)>>,
    next: Vec<AtomicUsize>,
    /// Episodes that a failure of a whole policy interrupted: each is played again with nobody beside it, which shows whose the
    /// failure was.
    alone: Mutex<VecDeque<(usize, EpisodeSpec)>>,
}

impl WorkQueue {
    /// By the slots of their places in the run.
    pub(crate) fn new(wanted: &[EpisodeSpec], slots: usize) -> WorkQueue {
        let mut by_slot = vec![Vec::new(); slots];
        for (at, spec) in wanted.iter().enumerate() {
            by_slot[spec.slot(slots)].push((at, *spec));
        }
        WorkQueue { by_slot, next: (0..slots).map(|_| AtomicUsize::new(0)).collect(), alone: Mutex::default() }
    }

    /// The next episode for a slot.
    pub(crate) fn next(&self, slot: usize) -> Option<(usize, EpisodeSpec)> {
        let at = self.next[slot].fetch_add(1, Ordering::Relaxed);
        self.by_slot[slot].get(at).copied()
    }

    /// Has these played again with nobody beside them.
    pub(crate) fn play_alone(&self, interrupted: impl Iterator<Item = (usize, EpisodeSpec)>) {
        self.alone.lock().unwrap_or_else(PoisonError::into_inner).extend(interrupted);
    }

    /// Whether somebody is to be played with nobody beside it.
    pub(crate) fn someone_waits_alone(&self) -> bool {
        !self.alone.lock().unwrap_or_else(PoisonError::into_inner).is_empty()
    }

    /// The next of those.
    pub(crate) fn next_alone(&self) -> Option<(usize, EpisodeSpec)> {
        self.alone.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }
}
