//! Which episode is explored, and what the agent is told in it.

use std::sync::Arc;

use super::Exploration;
use crate::episode::branches::Tree;
use crate::language::instruction;

impl Exploration {
    /// Opens the next house, or the next task of the set.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub fn next_episode(&mut self) -> anyhow::Result<()> {
        self.source.advance();
        self.enter()
    }

    /// Opens the house of another seed.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub(crate) fn seed(&mut self, seed: u64) -> anyhow::Result<()> {
        self.source.seek(seed);
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
        self.episode.examples = Arc::new(self.suggest());
        Ok(())
    }

    /// The episode has no end but success.
    pub(crate) fn unlimited(&mut self) {
        self.episode.limited = false;
        self.rollout.horizon = None;
        self.make_start();
    }

    /// Tells the agent something else, from the next step on; says what that means for the task.
    ///
    /// # Errors
    /// When the text is empty, too long, or holds control characters.
    pub(crate) fn instruct(&mut self, text: &str) -> anyhow::Result<&'static str> {
        let text = instruction::parse(text)?;
        self.rollout.instruction = text;
        self.acting.decision = None;
        let asked = self.episode.task.as_ref().is_some_and(|task| {
            instruction::normalise(&task.instruction) == instruction::normalise(&self.rollout.instruction)
        });
        Ok(match (self.rollout.env.grader.is_some(), asked) {
            (true, true) => "the task's own words",
            (true, false) => {
                self.rollout.env.grader = None;
                self.rollout.horizon = None;
                "the task no longer applies"
            }
            (false, true) => "the task's words again: reset to be graded",
            (false, false) => "applies from the next step",
        })
    }
}
