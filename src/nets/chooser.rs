//! The chooser of an agent with a memory: scores each macro action in its situation, and says how probably the present goal is
//! reached. Classes have vectors of their own, so that what is likely to be where can be learned.

use serde::{Deserialize, Serialize};
use tch::nn::{self, Module};
use tch::{Device, Kind, Tensor};

use super::bounds;
use crate::domain::Class;

/// The size of a chooser, or of a critic of what it chooses among.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChooserSpec {
    /// Numbers of a situation.
    pub(crate) situation: i64,
    /// Numbers of a macro action.
    pub(crate) action: i64,
    /// The length of a class's vector.
    pub(crate) embedding: i64,
    /// Widths of the hidden layers.
    pub(crate) hidden: Vec<i64>,
}

impl ChooserSpec {
    /// Whether such a network can be built. `name` is the section that holds these numbers.
    ///
    /// # Errors
    /// Names the field that is out of its bounds.
    pub(crate) fn check(&self, name: &str) -> anyhow::Result<()> {
        anyhow::ensure!((1..=4).contains(&self.hidden.len()), "{name}.hidden has {} entries", self.hidden.len());
        bounds::sizes(&format!("{name}.hidden"), &self.hidden, 8192)?;
        let numbers = [self.situation, self.action, self.embedding];
        bounds::sizes(&format!("{name}.situation, action or embedding"), &numbers, 8192)
    }
}

/// A batch of choices: n of them, with as many macro actions as the longest has.
#[derive(Debug)]
pub(crate) struct Choices {
    /// [n, situation].
    pub(crate) situation: Tensor,
    /// [n, 2] class indices of the goal's object and receptacle, 0 for none.
    pub(crate) goal: Tensor,
    /// [n, actions, action].
    pub(crate) actions: Tensor,
    /// [n, actions] class indices, 0 for none.
    pub(crate) classes: Tensor,
    /// [n, actions]: 1 where there is a macro action, 0 where a shorter choice is filled up.
    pub(crate) present: Tensor,
}

/// The network.
#[derive(Debug)]
pub(crate) struct Chooser {
    classes: nn::Embedding,
    layers: Vec<nn::Linear>,
    score: nn::Linear,
    done: Vec<nn::Linear>,
    is_done: nn::Linear,
    device: Device,
}

impl Chooser {
    /// A chooser with fresh weights under `path`.
    pub(crate) fn new(path: &nn::Path<'_>, spec: &ChooserSpec) -> Chooser {
        let ChooserSpec { situation, action, embedding, hidden } = spec;
        let layers = |name: &str, from: i64, widths: &[i64]| -> Vec<nn::Linear> {
            let inputs = std::iter::once(&from).chain(widths);
            let layer = |(i, (&from, &to)): (usize, (&i64, &i64))| {
                nn::linear(path / format!("{name}{}", i + 1), from, to, Default::default())
            };
            inputs.zip(widths).enumerate().map(layer).collect()
        };
        let width = hidden.last().copied().unwrap_or(1);
        Chooser {
            classes: nn::embedding(path / "classes", Class::VOCABULARY as i64, *embedding, Default::default()),
            layers: layers("layer", situation + action + 3 * embedding, hidden),
            score: nn::linear(path / "score", width, 1, Default::default()),
            done: layers("done", situation + 2 * embedding, &hidden[..1]),
            is_done: nn::linear(path / "is_done", hidden[0], 1, Default::default()),
            device: path.device(),
        }
    }

    /// The device of its weights.
    pub(crate) fn device(&self) -> Device {
        self.device
    }

    /// The logarithm of each macro action's probability [n, actions], and the logit of the goal's being reached `[n]`.
    pub(crate) fn forward(&self, choices: &Choices) -> (Tensor, Tensor) {
        let (n, actions) = (choices.actions.size()[0], choices.actions.size()[1]);
        let goal = self.classes.forward(&choices.goal).flatten(1, 2);
        let situation = Tensor::cat(&[&choices.situation, &goal], 1);
        let done = self.done.iter().fold(situation.shallow_clone(), |x, layer| layer.forward(&x).relu());
        let done = self.is_done.forward(&done).squeeze_dim(1);
        let width = situation.size()[1];
        let of_each = situation.unsqueeze(1).expand([n, actions, width], false);
        let class = self.classes.forward(&choices.classes);
        let x = Tensor::cat(&[&of_each, &choices.actions, &class], 2);
        let x = self.layers.iter().fold(x, |x, layer| layer.forward(&x).relu());
        let score = self.score.forward(&x).squeeze_dim(2);
        let absent = choices.present.eq(0.0);
        (score.masked_fill(&absent, -1e9).log_softmax(1, Kind::Float), done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filling_a_choice_up_changes_nothing_of_it() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(3);
        let store = nn::VarStore::new(Device::Cpu);
        let spec = ChooserSpec { situation: 5, action: 4, embedding: 3, hidden: vec![8, 8] };
        spec.check("chooser").unwrap();
        let chooser = Chooser::new(&store.root(), &spec);
        let (situation, goal) =
            (Tensor::rand([1, 5], (Kind::Float, Device::Cpu)), Tensor::from_slice(&[7i64, 0]).view([1, 2]));
        let actions = Tensor::rand([1, 3, 4], (Kind::Float, Device::Cpu));
        let choices = |count: i64| Choices {
            situation: situation.shallow_clone(),
            goal: goal.shallow_clone(),
            actions: actions.constant_pad_nd([0, 0, 0, count - 3]),
            classes: Tensor::from_slice(&[1i64, 0, 9]).view([1, 3]).constant_pad_nd([0, count - 3]),
            present: Tensor::ones([1, 3], (Kind::Float, Device::Cpu)).constant_pad_nd([0, count - 3]),
        };
        let [(short, done), (long, again)] = [3, 6].map(|count| chooser.forward(&choices(count)));
        assert!((short - long.narrow(1, 0, 3)).abs().max().double_value(&[]) < 1e-5);
        assert!((done - again).abs().max().double_value(&[]) < 1e-5);
        assert!(long.narrow(1, 3, 3).max().double_value(&[]) < -1e3);
    }
}
