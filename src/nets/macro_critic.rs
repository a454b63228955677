//! The critic of an agent with a memory: V of a situation for the present goal, and twin Q of each macro action in it.

use tch::Tensor;
use tch::nn::{self, Module};

use super::chooser::{Choices, ChooserSpec};
use super::value::ValueHead;
use crate::domain::Class;

/// V and two Q, which share the vectors of classes.
#[derive(Debug)]
pub(crate) struct MacroCritic {
    classes: nn::Embedding,
    value: ValueHead,
    twin_q: [ValueHead; 2],
}

impl MacroCritic {
    /// A critic with fresh weights under `path`, as large as such a chooser.
    pub(crate) fn new(path: &nn::Path<'_>, spec: &ChooserSpec) -> MacroCritic {
        let ChooserSpec { situation, action, embedding, hidden } = spec;
        let q = |name: &str| ValueHead::new(&(path / name), situation + action + 3 * embedding, hidden, 0.0);
        MacroCritic {
            classes: nn::embedding(path / "classes", Class::VOCABULARY as i64, *embedding, Default::default()),
            value: ValueHead::new(&(path / "value"), situation + 2 * embedding, hidden, 0.0),
            twin_q: [q("q1"), q("q2")],
        }
    }

    /// V `[n]` of the situations, for their goals.
    pub(crate) fn value(&self, choices: &Choices) -> Tensor {
        self.value.forward(&self.situation(choices), false)
    }

    /// Both Q [n, actions] of each macro action; what is filled up has a number, too, which means nothing.
    pub(crate) fn twin_q(&self, choices: &Choices) -> [Tensor; 2] {
        let (n, actions) = (choices.actions.size()[0], choices.actions.size()[1]);
        let situation = self.situation(choices).unsqueeze(1);
        let of_each = situation.expand([n, actions, situation.size()[2]], false);
        let class = self.classes.forward(&choices.classes);
        let input = Tensor::cat(&[&of_each, &choices.actions, &class], 2).flatten(0, 1);
        self.twin_q.each_ref().map(|q| q.forward(&input, false).view([n, actions]))
    }

    /// The smaller Q [n, actions] of each macro action.
    pub(crate) fn q(&self, choices: &Choices) -> Tensor {
        let [first, second] = self.twin_q(choices);
        first.minimum(&second)
    }

    fn situation(&self, choices: &Choices) -> Tensor {
        let goal = self.classes.forward(&choices.goal).flatten(1, 2);
        Tensor::cat(&[&choices.situation, &goal], 1)
    }
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind};

    use super::*;

    #[test]
    fn each_macro_action_has_the_q_that_it_has_alone_and_v_is_the_situations() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(3);
        let store = nn::VarStore::new(Device::Cpu);
        let spec = ChooserSpec { situation: 5, action: 4, embedding: 3, hidden: vec![8, 8] };
        let critic = MacroCritic::new(&store.root(), &spec);
        let rand = |shape: &[i64]| Tensor::rand(shape, (Kind::Float, Device::Cpu));
        let (situation, goal) = (rand(&[2, 5]), Tensor::from_slice(&[7i64, 0, 3, 9]).view([2, 2]));
        let (actions, classes) = (rand(&[2, 3, 4]), Tensor::from_slice(&[1i64, 0, 9, 4, 4, 0]).view([2, 3]));
        let choices = |from: i64, count: i64| Choices {
            situation: situation.shallow_clone(),
            goal: goal.shallow_clone(),
            actions: actions.narrow(1, from, count),
            classes: classes.narrow(1, from, count),
            present: Tensor::ones([2, count], (Kind::Float, Device::Cpu)),
        };
        let (all, last) = (critic.q(&choices(0, 3)), critic.q(&choices(2, 1)));
        assert!((all.narrow(1, 2, 1) - last).abs().max().double_value(&[]) < 1e-6);
        let [first, second] = critic.twin_q(&choices(0, 3));
        assert!(all.le_tensor(&first).logical_and(&all.le_tensor(&second)).all().int64_value(&[]) == 1);
        let [all, last] = [critic.value(&choices(0, 3)), critic.value(&choices(2, 1))];
        assert_eq!((all.size(), all.equal(&last)), (vec![2], true));
    }
}
