//! What a policy decided, and the distribution over everything that it could have done.

use super::value_estimates::Values;
use crate::domain::{Action, ActionType, Class};
use crate::house::view::Candidate;

/// The next action, and what led to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// What to do.
    pub(crate) action: Action,
    /// The distribution behind it, where the policy has one.
    pub(crate) distribution: Option<ActionDistribution>,
    /// What the critics say of the state, where the decision was weighed by them.
    pub(crate) values: Option<Values>,
    /// How likely the instruction is fulfilled in the state it was decided from, by the agent's own learned end; `None` where an
    /// agent has none.
    pub(crate) done: Option<f32>,
    /// The probability of each thing that could be done, in any order, where the environment's actions are its own; what is left
    /// out is impossible.
    pub(crate) own: Option<Vec<(Action, f32)>>,
}

impl Decision {
    /// From this probability on an agent says that it is done.
    const SAYS_DONE: f32 = 0.5;

    /// Whether the agent itself says that the instruction is fulfilled; `None` where it never says.
    pub(crate) fn says_done(&self) -> Option<bool> {
        self.done.map(|probability| probability >= Decision::SAYS_DONE)
    }

    /// What the agent's own end says, for a display: "done 0.07", "DONE 0.93".
    pub(crate) fn end_in_words(&self) -> Option<String> {
        let word = if self.says_done()? { "DONE" } else { "done" };
        Some(format!("{word} {:.2}", self.done?))
    }

    /// An action with nothing behind it, as a person or a script chooses.
    pub(crate) fn of(action: Action) -> Decision {
        Decision { action, distribution: None, values: None, done: None, own: None }
    }
}

/// A policy's distribution over what it could do now.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ActionDistribution {
    /// Probability of each action in the order of [`ActionType::ALL`], balanced, weighed and masked; `None` where masked.
    pub(crate) actions: [Option<f32>; ActionType::COUNT],
    /// Object classes by falling probability (before restriction to candidates and weighing), with whether one of that class
    /// is a candidate of the chosen or likeliest interaction.
    pub(crate) objects: Vec<(Class, f32, bool)>,
    /// The weight of each class among those that an interaction could name; all weigh alike where none is listed.
    pub(crate) choices: Vec<(ActionType, Class, f32)>,
    /// Entropy of the masked action distribution, in nats.
    pub(crate) entropy: f32,
    /// The action that argmax would choose.
    pub(crate) greedy: Action,
}

impl ActionDistribution {
    /// The distribution over everything that could be done now: navigation, and each interaction with each class that is a
    /// candidate of it, in the order of actions. Sums to 1.
    pub(crate) fn joint(&self, candidates: &[Candidate]) -> Vec<(ActionType, Option<Class>, f32)> {
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
