//! Recorded actions taken again by the rules alone: nothing has to be in view or in reach, as in recordings whose camera is
//! not ours.

use super::outcome::Outcome;
use super::rules;
use crate::domain::{Action, Scene, World};

/// Actions on their way through the states that they lead to.
pub(crate) struct Replay<'a> {
    scene: &'a Scene,
    world: World,
    actions: &'a [Action],
}

impl<'a> Replay<'a> {
    /// Before the first action.
    pub(crate) fn new(scene: &'a Scene, start: World, actions: &'a [Action]) -> Replay<'a> {
        Replay { scene, world: start, actions }
    }

    /// The present state.
    pub(crate) fn world(&self) -> &World {
        &self.world
    }

    /// The action that comes next.
    pub(crate) fn upcoming(&self) -> Option<Action> {
        self.actions.first().copied()
    }

    /// Takes the next action; `None` after the last.
    pub(crate) fn step(&mut self) -> Option<(Action, Outcome)> {
        let (&action, rest) = self.actions.split_first()?;
        self.actions = rest;
        Some((action, rules::apply(self.scene, &mut self.world, action)))
    }

    /// The state after the last action.
    pub(crate) fn finish(mut self) -> World {
        while self.step().is_some() {}
        self.world
    }
}
