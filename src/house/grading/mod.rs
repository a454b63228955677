//! Graders: which subtasks of a task are done.

use super::outcome::Outcome;
use crate::domain::skill::{Goal, Role, Subtask};
use crate::domain::{Action, Scene, World};

/// Follows a task's subtasks.
#[derive(Clone, Debug)]
pub struct Grader {
    roles: Vec<Role>,
    subtasks: Vec<Subtask>,
    completed: usize,
}

/// How strictly subtasks are graded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grading {
    /// By class.
    Class,
    /// As the released code does.
    Strict,
}

impl Grader {
    /// A grader at the start of a task.
    pub fn new(_grading: Grading, roles: &[Role], subtasks: &[Subtask], _goal: Option<&Goal>) -> Grader {
        Grader { roles: roles.to_vec(), subtasks: subtasks.to_vec(), completed: 0 }
    }

    /// Looks at the world after a step.
    pub fn observe(&mut self, _scene: &Scene, _world: &World, _action: Action, _outcome: Outcome) -> bool {
        false
    }

    /// How many subtasks are done.
    pub fn completed(&self) -> usize {
        self.completed
    }

    /// How many there are.
    pub fn total(&self) -> usize {
        self.subtasks.len()
    }

    /// Whether all are done.
    pub fn is_done(&self) -> bool {
        self.completed == self.subtasks.len()
    }

    /// The subtasks.
    pub fn subtasks(&self) -> &[Subtask] {
        &self.subtasks
    }

    /// The roles.
    pub fn roles(&self) -> &[Role] {
        &self.roles
    }
}
