//! The seam between a house and whatever acts in it.

use crate::domain::{Action, ActionType, Class};
use crate::house::grading::Grader;
use crate::house::session::House;

/// What a policy decides from.
pub struct Situation<'a> {
    /// The house; looking draws the frame once.
    pub house: &'a mut House,
    /// What is asked.
    pub instruction: &'a str,
    /// How many steps the episode has taken; deciding twice at one step looks once.
    pub step: u32,
    /// How far the task has come, where there is a task. Only the expert reads it.
    pub grader: Option<&'a Grader>,
}

/// The next action, and what led to it.
#[derive(Clone, Debug)]
pub struct Decision {
    /// What to do.
    pub action: Action,
    /// The distribution behind it, where the policy has one.
    pub mind: Option<Mind>,
}

/// A policy's distribution over what it could do now.
#[derive(Clone, Debug, PartialEq)]
pub struct Mind {
    /// Probability of each action in the order of [`ActionType::ALL`], after masking; `None` where masked.
    pub actions: [Option<f32>; ActionType::COUNT],
    /// Object classes by falling probability (before restriction to candidates), with whether one of that class is a
    /// candidate of the chosen or likeliest interaction.
    pub objects: Vec<(Class, f32, bool)>,
    /// Entropy of the masked action distribution, in nats.
    pub entropy: f32,
    /// The action that argmax would choose.
    pub greedy: Action,
}

/// What a critic makes of a situation.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// V: how likely the instruction will be fulfilled from here, discounted by how long it takes.
    pub value: f32,
    /// min(Q1, Q2) of everything that is possible now: the five ways to move, without a class, then each interaction with each
    /// class that is a candidate of it, nearest first.
    pub actions: Vec<(ActionType, Option<Class>, f32)>,
}

impl Values {
    /// Q of an action, if it is possible now.
    pub fn q(&self, kind: ActionType, class: Option<Class>) -> Option<f32> {
        self.actions.iter().find(|(own, of, _)| (*own, *of) == (kind, class)).map(|&(_, _, q)| q)
    }
}

/// Something that acts: a trained agent, the expert, chance.
pub trait Policy: Send {
    /// A short name for reports.
    fn name(&self) -> &str;

    /// Forgets the past: a new episode starts. `seed` drives whatever the policy draws by chance.
    fn begin(&mut self, seed: u64);

    /// Decides the next action.
    ///
    /// # Errors
    /// When the policy cannot go on (the expert sees no way, a forward pass fails); the episode then ends with that reason.
    fn decide(&mut self, situation: &mut Situation<'_>) -> anyhow::Result<Decision>;

    /// What its critic makes of the situation; nothing without a critic. Asked before or after deciding, it changes no decision.
    ///
    /// # Errors
    /// As [`Policy::decide`].
    fn values(&mut self, _situation: &mut Situation<'_>) -> anyhow::Result<Option<Values>> {
        Ok(None)
    }
}
