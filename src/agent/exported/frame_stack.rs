//! What an exported policy carries from step to step of an episode.

use std::collections::VecDeque;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The last frames that were seen, and random numbers.
#[derive(Clone, Debug)]
pub struct FrameStack {
    /// Planes, oldest first.
    pub(super) seen: VecDeque<Vec<u8>>,
    seen_at: Option<u32>,
    pub(super) rng: ChaCha8Rng,
}

impl FrameStack {
    pub(super) fn new(seed: u64) -> FrameStack {
        FrameStack { seen: VecDeque::new(), seen_at: None, rng: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// Looks at the frame of a step; deciding twice at one step looks once.
    pub(super) fn look(&mut self, planes: Vec<u8>, step: u32, history: usize) {
        if self.seen_at == Some(step) {
            self.seen.pop_back();
        }
        self.seen_at = Some(step);
        self.seen.push_back(planes);
        while self.seen.len() > history {
            self.seen.pop_front();
        }
    }
}
