//! Which episode is explored, and what the agent is told in it.

use std::sync::Arc;

use super::Session;
use crate::episode::branches::Tree;
use crate::episode::rollout::Rollout;
use crate::explore::episode_source::Opening;
use crate::house::House;
use crate::house::grading::{Grader, Grading};
use crate::language::instruction;

impl Session {
    /// Opens the next house, or the next task of the set.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub fn next_episode(&mut self) -> anyhow::Result<()> {
        self.openings.advance();
        self.enter_opened()
    }

    /// Opens the house of another seed.
    ///
    /// # Errors
    /// When it cannot be opened; the present one stays.
    pub fn seed(&mut self, seed: u64) -> anyhow::Result<()> {
        self.openings.seek(seed);
        self.enter_opened()
    }

    fn enter_opened(&mut self) -> anyhow::Result<()> {
        let opening = self.openings.open()?;
        self.seed = self.openings.seed();
        self.author.seed = self.seed;
        self.rollout = rollout_of(&opening);
        self.task = opening.task;
        self.reference = opening.reference;
        self.limited = opening.limited;
        self.episode += 1;
        self.decision = None;
        self.frame = None;
        if let Some(policy) = &mut self.policy {
            policy.reset(0, self.seed);
        }
        self.tree = Tree::new(self.moment());
        self.examples = Arc::new(self.suggest());
        Ok(())
    }

    /// The episode has no end but success.
    pub fn unlimited(&mut self) {
        self.limited = false;
        self.rollout.horizon = None;
        self.plant();
    }

    /// Tells the agent something else, from the next step on; says what that means for the task.
    ///
    /// # Errors
    /// When the text is empty, too long, or holds control characters.
    pub fn instruct(&mut self, text: &str) -> anyhow::Result<&'static str> {
        let text = instruction::parse(text)?;
        self.rollout.instruction = text;
        self.decision = None;
        let asked = self.task.as_ref().is_some_and(|task| {
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

pub(crate) fn rollout_of(opening: &Opening) -> Rollout {
    let house = House::new(opening.scene.clone(), opening.world.clone());
    match &opening.task {
        // What a person made up is not graded.
        Some(task) if task.subtasks.is_empty() => Rollout::in_house(house, task.instruction.clone(), None, None),
        Some(task) => {
            let grader = Grader::new(Grading::Class, &task.roles, &task.subtasks, task.goal.as_ref());
            Rollout::in_house(house, task.instruction.clone(), Some(grader), opening.limited.then_some(task.horizon))
        }
        None => Rollout::in_house(house, "look around".into(), None, None),
    }
}
