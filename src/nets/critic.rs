//! The critic: twin Q(s, a, z) and V(s, z).

use serde::{Deserialize, Serialize};
use tch::Tensor;
use tch::nn::{self, Module};

use super::bounds;
use super::precision;
use super::shared_rows::SharedRows;
use super::trunk::{Conditioning, Convolutions, DenseLayers, Trunk};
use super::value::ValueHead;
use crate::domain::{ActionType, Class};

/// The size of a critic. Its inputs are the policy's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CriticSpec {
    /// Channels of a trunk's four convolutions.
    pub(crate) channels: [i64; 4],
    /// Whether the second convolution reads every other place.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) downsample: bool,
    /// Width of the fully connected layers of each head.
    pub(crate) hidden: Vec<i64>,
    /// Share of the fully connected units that is dropped in training.
    pub(crate) dropout: f64,
    /// Numbers that stand for an action.
    pub(crate) action_embedding: i64,
    /// Numbers that stand for an object class; navigation has the class `None`.
    pub(crate) object_embedding: i64,
    /// Whether both Q and V read one trunk. The paper's have one each.
    pub(crate) shared_trunk: bool,
}

impl CriticSpec {
    /// Whether there can be a critic of this size.
    ///
    /// # Errors
    /// Names the field of `critic` that is out of its bounds.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        bounds::sizes("critic.channels", &self.channels, 4096)?;
        bounds::sizes("critic.hidden", &self.hidden, 16_384)?;
        bounds::sizes("critic.action_embedding", &[self.action_embedding], 8192)?;
        bounds::sizes("critic.object_embedding", &[self.object_embedding], 8192)?;
        bounds::dropout("critic.dropout", self.dropout)
    }

    /// Whether a critic of this size can take another's weights: dropout is no matter of size.
    pub(crate) fn fits(&self, other: &CriticSpec) -> bool {
        CriticSpec { dropout: other.dropout, ..self.clone() } == *other
    }
}

/// The sizes of a critic's inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CriticInputs {
    /// Channels of an observation.
    pub(crate) channels: i64,
    /// Numbers in a sentence embedding, or in the vector that a goal becomes.
    pub(crate) conditioning: i64,
    /// The channels of the convolutions that see a goal, where there is one.
    pub goal: Option<[i64; 4]>,
}

#[derive(Debug)]
struct QHead {
    action: nn::Embedding,
    object: nn::Embedding,
    dense: DenseLayers,
    out: nn::Linear,
}

impl QHead {
    fn new(path: &nn::Path<'_>, from: i64, spec: &CriticSpec) -> QHead {
        let from = from + spec.action_embedding + spec.object_embedding;
        let dense = DenseLayers::new(path, from, &spec.hidden, spec.dropout);
        let table = |name: &str, entries: usize, width: i64| {
            nn::embedding(path / name, entries as i64, width, Default::default())
        };
        QHead {
            action: table("action", ActionType::COUNT, spec.action_embedding),
            object: table("object", Class::VOCABULARY, spec.object_embedding),
            out: nn::linear(path / "out", dense.width(), 1, Default::default()),
            dense,
        }
    }

    fn forward(&self, input: &Tensor, actions: &Tensor, objects: &Tensor, train: bool) -> Tensor {
        let chosen = [self.action.forward(actions), self.object.forward(objects)].map(|x| x.to_kind(input.kind()));
        let joined = Tensor::cat(&[input, &chosen[0], &chosen[1]], 1);
        precision::linear_f32(&self.out, &self.dense.forward(joined, train)).squeeze_dim(1)
    }
}

/// Q and V of a batch in training.
#[derive(Debug)]
pub(crate) struct CriticValues {
    /// Both Q, each `[n]`.
    pub(crate) q: [Tensor; 2],
    /// V `[n]`.
    pub(crate) value: Tensor,
    /// V `[n]` of the same features without dropout and without gradient: what advantages are measured against.
    pub(crate) baseline: Tensor,
}

/// Twin Q and V over one trunk or one each.
#[derive(Debug)]
pub(crate) struct Critic {
    conditioner: Conditioning,
    trunks: Vec<Trunk>,
    q: [QHead; 2],
    value: ValueHead,
}

impl Critic {
    /// A critic with fresh weights under `path`.
    pub(crate) fn new(path: &nn::Path<'_>, spec: &CriticSpec, inputs: CriticInputs) -> Critic {
        let names: &[&str] = if spec.shared_trunk { &["trunk"] } else { &["trunk1", "trunk2", "trunk_value"] };
        let over = |channels| Convolutions { channels, downsample: spec.downsample };
        let trunk =
            |name: &&str| Trunk::new(&(path / *name), inputs.channels, over(&spec.channels), Some(inputs.conditioning));
        let trunks: Vec<Trunk> = names.iter().map(trunk).collect();
        let from = trunks[0].width() + inputs.conditioning;
        Critic {
            conditioner: Conditioning::new(path, inputs.conditioning, inputs.goal.as_ref().map(over), inputs.channels),
            trunks,
            q: ["q1", "q2"].map(|name| QHead::new(&(path / name), from, spec)),
            value: ValueHead::new(&(path / "value"), from, &spec.hidden, spec.dropout),
        }
    }

    /// The input of head `head` (0 and 1: Q, 2: V), given what an earlier head read.
    fn input(
        &self,
        head: usize,
        observations: &SharedRows,
        conditioning: &Tensor,
        earlier: Option<&Tensor>,
        train: bool,
    ) -> Tensor {
        match (earlier, &self.trunks[..]) {
            (Some(earlier), [_]) => earlier.shallow_clone(),
            (_, trunks) => {
                let trunk = &trunks[head.min(trunks.len() - 1)];
                Tensor::cat(&[&trunk.forward_shared(observations, Some(conditioning), train), conditioning], 1)
            }
        }
    }

    /// Q and V of a batch in training: `conditioning` as the policy's, `actions` and `objects` `[n]`
    /// (class indices, 0 for navigation).
    pub(crate) fn evaluate(
        &self,
        observations: &SharedRows,
        conditioning: &SharedRows,
        actions: &Tensor,
        objects: &Tensor,
    ) -> CriticValues {
        let conditioning = self.conditioner.for_items(conditioning, observations.kind(), true);
        let first = self.input(0, observations, &conditioning, None, true);
        let second = self.input(1, observations, &conditioning, Some(&first), true);
        let third = self.input(2, observations, &conditioning, Some(&first), true);
        CriticValues {
            q: [(0, &first), (1, &second)].map(|(k, input)| self.q[k].forward(input, actions, objects, true)),
            value: self.value.forward(&third, true),
            baseline: tch::no_grad(|| self.value.forward(&third, false)),
        }
    }

    /// min(Q1, Q2) [n], without dropout and without gradient.
    pub(crate) fn min_q(
        &self,
        observations: &SharedRows,
        conditioning: &SharedRows,
        actions: &Tensor,
        objects: &Tensor,
    ) -> Tensor {
        tch::no_grad(|| {
            let conditioning = self.conditioner.for_items(conditioning, observations.kind(), false);
            let first = self.input(0, observations, &conditioning, None, false);
            let second = self.input(1, observations, &conditioning, Some(&first), false);
            let [one, other] =
                [(0, &first), (1, &second)].map(|(k, input)| self.q[k].forward(input, actions, objects, false));
            one.minimum(&other)
        })
    }

    /// V [n], without dropout and without gradient.
    pub(crate) fn value(&self, observations: &SharedRows, conditioning: &SharedRows) -> Tensor {
        tch::no_grad(|| {
            let conditioning = self.conditioner.for_items(conditioning, observations.kind(), false);
            self.value.forward(&self.input(2, observations, &conditioning, None, false), false)
        })
    }

    /// V of one observation and min(Q1, Q2) of each (action, object) pair; the trunk runs once.
    pub(crate) fn evaluate_actions(
        &self,
        observation: &Tensor,
        conditioning: &Tensor,
        pairs: &[(i64, i64)],
    ) -> (Tensor, Tensor) {
        let column = |of: fn(&(i64, i64)) -> i64| {
            Tensor::from_slice(&pairs.iter().map(of).collect::<Vec<i64>>()).to_device(observation.device())
        };
        let (actions, objects) = (column(|pair| pair.0), column(|pair| pair.1));
        tch::no_grad(|| {
            let conditioning = self.conditioner.forward(conditioning, observation.kind(), false);
            let observation = SharedRows::own(observation);
            let first = self.input(0, &observation, &conditioning, None, false);
            let [second, third] = [1, 2].map(|head| self.input(head, &observation, &conditioning, Some(&first), false));
            let inputs = [first, second, third];
            let rows = pairs.len() as i64;
            let [one, other] =
                [0, 1].map(|k| self.q[k].forward(&inputs[k].expand([rows, -1], false), &actions, &objects, false));
            (self.value.forward(&inputs[2], false), one.minimum(&other))
        })
    }
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind};

    use super::*;
    use crate::nets::visual::SIDE;

    fn critic(store: &nn::VarStore, shared_trunk: bool) -> Critic {
        let spec = CriticSpec {
            channels: [4; 4],
            downsample: false,
            hidden: vec![8],
            dropout: 0.2,
            action_embedding: 6,
            object_embedding: 3,
            shared_trunk,
        };
        Critic::new(&store.root(), &spec, CriticInputs { channels: 10, conditioning: 5, goal: None })
    }

    fn inputs(n: i64) -> (Tensor, Tensor, Tensor, Tensor) {
        let float = (Kind::Float, Device::Cpu);
        let indices = |high: i64| Tensor::randint(high, [n], (Kind::Int64, Device::Cpu));
        (Tensor::rand([n, 10, SIDE, SIDE], float), Tensor::rand([n, 5], float), indices(12), indices(82))
    }

    #[test]
    fn a_shared_trunk_has_a_third_of_the_convolutions_and_all_shapes_agree() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(2);
        let (observation, conditioning, actions, objects) = inputs(3);
        let convolutions = [true, false].map(|shared| {
            let store = nn::VarStore::new(Device::Cpu);
            let critic = critic(&store, shared);
            let values =
                critic.evaluate(&SharedRows::own(&observation), &SharedRows::own(&conditioning), &actions, &objects);
            assert!([&values.q[0], &values.q[1], &values.value, &values.baseline].iter().all(|t| t.size() == [3]));
            assert!(values.value.requires_grad() && !values.baseline.requires_grad());
            store.variables().keys().filter(|name| name.ends_with("conv.weight")).count()
        });
        assert_eq!(convolutions, [4, 12]);
    }

    #[test]
    fn pairs_of_one_observation_are_valued_as_in_a_batch() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(3);
        for shared in [true, false] {
            let store = nn::VarStore::new(Device::Cpu);
            let critic = critic(&store, shared);
            let (observation, conditioning, ..) = inputs(1);
            let pairs = [(0, 0), (5, 2), (5, 40), (9, 81)];
            let (value, q) = critic.evaluate_actions(&observation, &conditioning, &pairs);
            let (actions, objects) = (Tensor::from_slice(&pairs.map(|p| p.0)), Tensor::from_slice(&pairs.map(|p| p.1)));
            let repeat = |tensor: &Tensor| tensor.repeat([&[4i64][..], &vec![1; tensor.dim() - 1]].concat());
            let (many, conditionings) =
                (SharedRows::from(repeat(&observation)), SharedRows::from(repeat(&conditioning)));
            let close = |a: &Tensor, b: &Tensor| (a - b).abs().max().double_value(&[]) < 1e-5;
            assert!(close(&q, &critic.min_q(&many, &conditionings, &actions, &objects)));
            assert!(close(&value, &critic.value(&many, &conditionings)));
            assert!((q.max() - q.min()).double_value(&[]) > 1e-4, "the action matters");
        }
    }

    #[test]
    fn items_that_share_an_observation_are_valued_as_those_that_have_one_each() {
        let _chance = crate::nets::testing::chance();
        for shared in [true, false] {
            tch::manual_seed(5);
            let store = nn::VarStore::new(Device::Cpu);
            let critic = critic(&store, shared);
            let (maps, conditioning, actions, objects) = inputs(4);
            let rows = Tensor::from_slice(&[1i64, 0, 1, 1]);
            let each = SharedRows::own(&maps.narrow(0, 0, 2).index_select(0, &rows));
            let together = SharedRows { distinct: maps.narrow(0, 0, 2), rows: Some(rows) };
            let values = [each, together].map(|observations| {
                critic
                    .evaluate(&observations, &SharedRows::own(&conditioning), &actions, &objects)
                    .baseline
                    .to_kind(Kind::Double)
            });
            let apart = (&values[0] - &values[1]).abs().max().double_value(&[]);
            assert!(apart < 1e-5, "{apart}");
        }
    }
}
