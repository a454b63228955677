//! What a checkpoint's critics make of a situation, and how that weighs what its policy would do.

use tch::{Device, Tensor};

use crate::domain::{ActionType, Class};
use crate::house::view::Candidate;
use crate::nets::critic::Critic;

/// The values of one situation under one instruction.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// V of the state.
    pub(crate) state: f32,
    /// Q of what could be done: navigation once each, interactions once for each class that is a candidate.
    pub(crate) choices: Vec<ChoiceValue>,
}

/// The value of one thing that could be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ChoiceValue {
    /// The action.
    pub(crate) kind: ActionType,
    /// The class that it is done to, for interactions.
    pub(crate) class: Option<Class>,
    /// The smaller of both critics' Q.
    pub(crate) q: f32,
}

impl Values {
    /// What a critic makes of an observation [1, ...] under its conditioning [1, ...], where there are these candidates.
    ///
    /// # Errors
    /// When the critic's answer cannot be read.
    pub(crate) fn of(
        critic: &Critic,
        observation: &Tensor,
        conditioning: &Tensor,
        candidates: &[Candidate],
    ) -> anyhow::Result<Values> {
        let mut possible: Vec<(ActionType, Option<Class>)> =
            ActionType::ALL.into_iter().filter(|kind| !kind.is_interaction()).map(|kind| (kind, None)).collect();
        for candidate in candidates {
            let pair = (candidate.kind, Some(candidate.class));
            if candidate.class.in_vocabulary() && !possible.contains(&pair) {
                possible.push(pair);
            }
        }
        let index = |&(kind, class): &(ActionType, Option<Class>)| {
            (kind.index() as i64, class.map_or(0, |class| class.index() as i64))
        };
        let pairs: Vec<(i64, i64)> = possible.iter().map(index).collect();
        let (value, q) = critic.evaluate_actions(observation, conditioning, &pairs);
        let q = Vec::<f32>::try_from(q.to_device(Device::Cpu))?;
        let choices = possible.into_iter().zip(q).map(|((kind, class), q)| ChoiceValue { kind, class, q }).collect();
        Ok(Values { state: value.double_value(&[0]) as f32, choices })
    }

    /// Q of an action on a class.
    pub(crate) fn q(&self, kind: ActionType, class: Option<Class>) -> Option<f32> {
        self.choices.iter().find(|choice| choice.kind == kind && choice.class == class).map(|choice| choice.q)
    }

    /// How much better than the state's value that is.
    pub(crate) fn advantage(&self, kind: ActionType, class: Option<Class>) -> Option<f32> {
        Some(self.q(kind, class)? - self.state)
    }
}

/// How values weigh what a policy would do: a choice of advantage A is exp(weight x A) times as likely. With IQL's temperature
/// as the weight that is where its policy extraction ends: the best of its loss is the demonstrated policy times exp(temperature
/// x A) (Peng et al., 2019, equation 9), which a network of few updates is far from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AdvantageScale<'a> {
    pub(crate) values: &'a Values,
    /// How much they count.
    pub(crate) weight: f32,
}

impl AdvantageScale<'_> {
    /// How many times as likely a choice becomes; 1 where nothing is known of it.
    pub(crate) fn factor(&self, kind: ActionType, class: Option<Class>) -> f32 {
        self.values.advantage(kind, class).map_or(1.0, |advantage| (self.weight * advantage).exp())
    }
}
