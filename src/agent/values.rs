//! What a checkpoint's critics make of a situation.

use crate::domain::{ActionType, Class};

/// The values of one situation under one instruction.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// V of the state.
    pub state: f32,
    /// Q of what could be done: navigation once each, interactions once for each class that is a candidate.
    pub choices: Vec<ChoiceValue>,
}

/// The value of one thing that could be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChoiceValue {
    /// The action.
    pub kind: ActionType,
    /// The class that it is done to, for interactions.
    pub class: Option<Class>,
    /// The smaller of both critics' Q.
    pub q: f32,
}

impl Values {
    /// Q of an action on a class.
    pub fn q(&self, kind: ActionType, class: Option<Class>) -> Option<f32> {
        self.choices.iter().find(|choice| choice.kind == kind && choice.class == class).map(|choice| choice.q)
    }

    /// How much better than the state's value that is.
    pub fn advantage(&self, kind: ActionType, class: Option<Class>) -> Option<f32> {
        Some(self.q(kind, class)? - self.state)
    }
}
