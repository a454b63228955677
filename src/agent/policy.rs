//! The seam between a house and whatever acts in it.

use rand_chacha::ChaCha8Rng;

use super::frame_history::FrameHistory;
use super::value_estimates::Values;
use crate::domain::{Action, ActionType, Class};
use crate::house::expert::Plan;
use crate::house::grading::Grader;
use crate::house::session::House;
use crate::house::view::Candidate;

/// What a policy decides from.
pub struct Observation<'a> {
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
    pub mind: Option<ActionDistribution>,
}

/// A policy's distribution over what it could do now.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionDistribution {
    /// Probability of each action in the order of [`ActionType::ALL`], balanced, weighed and masked; `None` where masked.
    pub actions: [Option<f32>; ActionType::COUNT],
    /// Object classes by falling probability (before restriction to candidates and weighing), with whether one of that class
    /// is a candidate of the chosen or likeliest interaction.
    pub objects: Vec<(Class, f32, bool)>,
    /// The weight of each class among those that an interaction could name; all weigh alike where none is listed.
    pub choices: Vec<(ActionType, Class, f32)>,
    /// Entropy of the masked action distribution, in nats.
    pub entropy: f32,
    /// The action that argmax would choose.
    pub greedy: Action,
}

impl ActionDistribution {
    /// The distribution over everything that could be done now: navigation, and each interaction with each class that is a
    /// candidate of it, in the order of actions. Sums to 1.
    pub fn joint(&self, candidates: &[Candidate]) -> Vec<(ActionType, Option<Class>, f32)> {
        let share = |kind: ActionType, class: Class| {
            let mut weights = self.choices.iter().filter(|choice| (choice.0, choice.1) == (kind, class));
            weights.next().map_or(0.0, |choice| choice.2)
        };
        let mut found = Vec::new();
        for kind in ActionType::ALL {
            let p = self.actions[kind.index()].unwrap_or(0.0);
            if !kind.is_interaction() {
                found.push((kind, None, p));
                continue;
            }
            let mut classes: Vec<Class> = Vec::new();
            for candidate in candidates.iter().filter(|candidate| candidate.kind == kind) {
                if !classes.contains(&candidate.class) {
                    classes.push(candidate.class);
                }
            }
            let all: f32 = classes.iter().map(|&class| share(kind, class)).sum();
            for &class in &classes {
                let part = if all > 0.0 { share(kind, class) / all } else { 1.0 / classes.len() as f32 };
                found.push((kind, Some(class), p * part));
            }
        }
        found
    }
}

/// How much of an instruction an agent reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Tokens that are read.
    pub tokens: usize,
    /// Tokens at the end that are left out because the text is too long.
    pub cut: usize,
}

/// What a policy carries from one step to the next. Put back, it decides as it did then, bit for bit.
#[derive(Clone, Debug, Default)]
pub enum PolicyState {
    /// Nothing.
    #[default]
    Nothing,
    /// Its chance.
    Chance(Box<ChaCha8Rng>),
    /// What it is about to do.
    Plan(Box<Plan>),
    /// The last frames, and its chance.
    Frames(Box<FrameHistory>),
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
    fn decide(&mut self, situation: &mut Observation<'_>) -> anyhow::Result<Decision>;

    /// What it carries now.
    fn carried(&self) -> PolicyState {
        PolicyState::Nothing
    }

    /// Takes back what it carried at another step.
    fn put_back(&mut self, _carried: PolicyState) {}

    /// Whether it draws its actions by chance instead of taking the likeliest, where it can do either.
    fn set_sampling(&mut self, _samples: bool) {}

    /// What its sentence encoder makes of an instruction, where it has one.
    fn reading(&self, _instruction: &str) -> Option<Reading> {
        None
    }

    /// What its critics make of a situation; `None` without critics. It changes nothing about what is decided next.
    ///
    /// # Errors
    /// When a forward pass fails.
    fn values(&mut self, _situation: &mut Observation<'_>) -> anyhow::Result<Option<Values>> {
        Ok(None)
    }
}
