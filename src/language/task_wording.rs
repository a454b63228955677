//! A task as it is put into words: who plays which role, and how a thing is spoken of at a step.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::grammar::{grammar, with_article};
use crate::domain::Class;
use crate::domain::skill::{Role, SkillKind, Subtask};

/// What is known of a task when it is put into words.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TaskWording<'a> {
    /// The parts that instances play.
    pub(crate) roles: &'a [Role],
    /// The steps, in order.
    pub(crate) subtasks: &'a [Subtask],
    /// For each role, the class of the receptacle in which its instance lies at the start; may be shorter than the roles.
    pub(crate) origins: &'a [Option<Class>],
}

impl TaskWording<'_> {
    /// The role's class.
    pub(super) fn class(&self, role: u8) -> Class {
        self.roles.get(usize::from(role)).map_or(Class::NONE, |role| role.class)
    }

    /// Whether two roles ask for the same: one class, whole or sliced.
    pub(super) fn alike(&self, a: u8, b: u8) -> bool {
        let asked = |role: u8| self.roles.get(usize::from(role)).map(|role| (role.class, role.slice));
        asked(a) == asked(b)
    }

    /// Whether the role is a slice.
    pub(super) fn is_slice(&self, role: u8) -> bool {
        self.roles.get(usize::from(role)).is_some_and(|role| role.slice)
    }

    /// The thing with an article, as one speaks of it at a step: "the mug", "a slice of bread", "another potato".
    pub(super) fn thing(&self, role: u8, step: usize, rng: &mut ChaCha8Rng) -> String {
        let class = self.class(role);
        let before = &self.subtasks[..step.min(self.subtasks.len())];
        let mut named = before.iter().flat_map(|subtask| std::iter::once(subtask.object).chain(subtask.receptacle));
        let is_known = named.clone().any(|other| other == role);
        let is_second = !is_known && named.any(|other| self.alike(other, role));
        let noun = match (self.is_slice(role), rng.random_range(0..4)) {
            (true, 0) => format!("{} slice", class.spoken()),
            (true, 1) => format!("piece of {}", class.spoken()),
            (true, _) => format!("slice of {}", class.spoken()),
            (false, _) => grammar().name(class, rng).to_string(),
        };
        if is_second {
            let which = ["another", "another", "the other", "a second", "one more"][rng.random_range(0..5u32) as usize];
            return format!("{which} {noun}");
        }
        // Only what can be carried comes in such numbers that any one will do.
        let any_will_do = class.info().pickupable && !is_known && rng.random_bool(0.3);
        match (any_will_do, self.is_slice(role)) {
            (true, true) => with_article(&noun),
            (true, false) => grammar().one(class),
            (false, _) => format!("the {noun}"),
        }
    }

    /// Whether the step before leaves its object in the hand.
    pub(super) fn holds_before(&self, step: usize) -> bool {
        let holding = [SkillKind::Pickup, SkillKind::Clean, SkillKind::Heat, SkillKind::Cool];
        step > 0 && holding.contains(&self.subtasks[step - 1].skill)
    }
}
