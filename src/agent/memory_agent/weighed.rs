//! What could be done in a state, as the networks weigh it.

use tch::Device;

use super::macro_action::MacroAction;
use crate::agent::value_estimates::{AdvantageScale, ChoiceValue, Values};
use crate::nets::chooser::Choices;
use crate::nets::macro_critic::MacroCritic;

/// What could be done in a state.
pub(super) struct Weighed {
    pub(super) actions: Vec<MacroAction>,
    /// The same as a batch of one, for networks.
    pub(super) choices: Choices,
    /// How probably the instruction is fulfilled.
    pub(super) done: f32,
    /// How probable each macro action is.
    pub(super) probabilities: Vec<f32>,
}

impl Weighed {
    /// V of the state for the present goal, and Q of each beginning: of macro actions that begin alike the best one's.
    ///
    /// # Errors
    /// When the critic's answer cannot be read.
    pub(super) fn values(&self, critic: &MacroCritic) -> anyhow::Result<Values> {
        let (value, q) = tch::no_grad(|| (critic.value(&self.choices), critic.q(&self.choices)));
        let q = Vec::<f32>::try_from(q.squeeze_dim(0).to_device(Device::Cpu))?;
        let mut choices: Vec<ChoiceValue> = Vec::new();
        for (action, q) in self.actions.iter().zip(q) {
            let (kind, class) = action.beginning();
            match choices.iter_mut().find(|known| (known.kind, known.class) == (kind, class)) {
                Some(known) => known.q = known.q.max(q),
                None => choices.push(ChoiceValue { kind, class, q }),
            }
        }
        Ok(Values { state: value.double_value(&[0]) as f32, choices })
    }

    /// Makes what has an advantage likelier.
    pub(super) fn scale(&mut self, by: &AdvantageScale<'_>) {
        for (action, probability) in self.actions.iter().zip(&mut self.probabilities) {
            let (kind, class) = action.beginning();
            *probability *= by.factor(kind, class);
        }
        let total: f32 = self.probabilities.iter().sum();
        self.probabilities.iter_mut().for_each(|probability| *probability /= total);
    }
}
