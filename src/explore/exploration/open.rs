//! Which episode is explored.

use super::Exploration;
use crate::episode::branches::Tree;

impl Exploration {
    /// Opens the next house, or the next task of the set.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub fn next_episode(&mut self) -> anyhow::Result<()> {
        self.source.advance()?;
        self.enter()
    }

    /// Opens the house of another seed.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub(crate) fn seed(&mut self, seed: u64) -> anyhow::Result<()> {
        self.source.seek(seed)?;
        self.enter()
    }

    fn enter(&mut self) -> anyhow::Result<()> {
        let start = self.source.open()?;
        self.episode.seed = self.source.seed();
        self.acting.author.seed = self.episode.seed;
        self.rollout = start.rollout();
        self.episode.task = start.task;
        self.episode.reference = start.reference;
        self.episode.limited = start.limited;
        self.episode.number += 1;
        self.acting.decision = None;
        self.frames.present = None;
        if let Some(policy) = &mut self.acting.policy {
            policy.reset(0, self.episode.seed);
        }
        self.tree = Tree::new(self.saved_state());
        self.begin_wishes();
        self.count_as_saved();
        Ok(())
    }

    /// The episode has no end but success.
    pub(crate) fn unlimited(&mut self) {
        self.episode.limited = false;
        self.rollout.horizon = None;
        self.make_start();
    }
}
