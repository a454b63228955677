//! The policy network: the trunk, or attention; fully connected layers; and two heads.

use serde::{Deserialize, Serialize};
use tch::Tensor;
use tch::nn;

use super::bounds;
use super::episodic::{AttentionSpec, Episodic};
use super::precision;
use super::shared_rows::SharedRows;
use super::trunk::{Conditioning, Convolutions, DenseLayers, Trunk};
use crate::domain::{ActionType, Class};

/// The size of a policy network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicySpec {
    /// Frames in an observation, the present one last.
    pub history: i64,
    /// Numbers in a sentence embedding, or in a token's where the agent reads words.
    pub embedding: i64,
    /// Channels of the four convolutions; the first is 1 x 1, the others 3 x 3.
    pub(crate) channels: [i64; 4],
    /// Whether the second convolution reads every other place.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) downsample: bool,
    /// Width of the fully connected layers.
    pub(crate) hidden: Vec<i64>,
    /// Share of the fully connected units that is dropped in training.
    pub(crate) dropout: f64,
    /// Where a state to reach takes the place of an instruction: the channels of the four convolutions that see it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal_channels: Option<[i64; 4]>,
    /// Where the agent reads words and attends to them: the attention layers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attention: Option<AttentionSpec>,
}

impl PolicySpec {
    /// Whether there can be a network of this size.
    ///
    /// # Errors
    /// Names the field of `policy` that is out of its bounds.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        bounds::sizes("policy.history", &[self.history], 64)?;
        bounds::sizes("policy.embedding", &[self.embedding], 8192)?;
        bounds::sizes("policy.channels", &self.channels, 4096)?;
        bounds::sizes("policy.hidden", &self.hidden, 16_384)?;
        bounds::dropout("policy.dropout", self.dropout)?;
        if let Some(channels) = &self.goal_channels {
            bounds::sizes("policy.goal_channels", channels, 4096)?;
        }
        self.attention.as_ref().map_or(Ok(()), |attention| attention.check(self.embedding))
    }

    /// Whether it is conditioned on sentence embeddings, and not on words or a goal.
    pub(crate) fn reads_sentences(&self) -> bool {
        self.attention.is_none() && self.goal_channels.is_none()
    }

    /// Whether a network of this size can take another's weights: dropout is no matter of size.
    pub(crate) fn fits(&self, other: &PolicySpec) -> bool {
        PolicySpec { dropout: other.dropout, ..self.clone() } == *other
    }
}

/// Logits of both heads, in 32 bits.
#[derive(Debug)]
pub(crate) struct Logits {
    /// [n, 12]: what to do.
    pub(crate) actions: Tensor,
    /// [n, 82]: to which class; entry 0 is `None`.
    pub(crate) objects: Tensor,
}

/// How the observation and the conditioning become features.
#[derive(Debug)]
enum Body {
    Trunk { conditioner: Conditioning, trunk: Trunk },
    Episodic(Box<Episodic>),
}

/// From the last few frames and an instruction or goal to logits of actions and object classes.
#[derive(Debug)]
pub(crate) struct PolicyNet {
    body: Body,
    dense: DenseLayers,
    actions: nn::Linear,
    objects: nn::Linear,
}

impl PolicyNet {
    /// A network with fresh weights under `path`, over maps of `features` channels a frame.
    pub(crate) fn new(path: &nn::Path<'_>, spec: &PolicySpec, features: i64) -> PolicyNet {
        let from = spec.history * features;
        let over = |channels| Convolutions { channels, downsample: spec.downsample };
        let (body, width) = match &spec.attention {
            Some(attention) => {
                let (frames, tokens) = ((spec.history, features), (spec.embedding, over(&spec.channels), spec.dropout));
                (Body::Episodic(Box::new(Episodic::new(path, attention, frames, tokens))), spec.embedding)
            }
            None => {
                let trunk = Trunk::new(path, from, over(&spec.channels), Some(spec.embedding));
                let conditioner = Conditioning::new(path, spec.embedding, spec.goal_channels.as_ref().map(over), from);
                let width = trunk.width();
                (Body::Trunk { conditioner, trunk }, width + spec.embedding)
            }
        };
        let dense = DenseLayers::new(path, width, &spec.hidden, spec.dropout);
        PolicyNet {
            body,
            actions: nn::linear(path / "actions", dense.width(), ActionType::COUNT as i64, Default::default()),
            objects: nn::linear(path / "objects", dense.width(), Class::VOCABULARY as i64, Default::default()),
            dense,
        }
    }

    /// `observation` [n, history * features, 7, 7], oldest frame first, and `conditioning`: sentences [n, embedding] of unit length,
    /// goals of the observation's shape, or numbers of words [n, words].
    pub(crate) fn forward(&self, observation: &Tensor, conditioning: &Tensor, train: bool) -> Logits {
        self.forward_shared(&SharedRows::own(observation), &SharedRows::own(conditioning), train)
    }

    /// The same of items that may share observations, and goals or instructions.
    pub(crate) fn forward_shared(&self, observations: &SharedRows, conditioning: &SharedRows, train: bool) -> Logits {
        let features = match &self.body {
            Body::Episodic(episodic) => {
                let all = |shared: &SharedRows| shared.for_items(shared.distinct.shallow_clone());
                episodic.forward(&all(observations), &all(conditioning), train)
            }
            Body::Trunk { conditioner, trunk } => {
                let conditioning = conditioner.for_items(conditioning, observations.kind(), train);
                Tensor::cat(&[trunk.forward_shared(observations, Some(&conditioning), train), conditioning], 1)
            }
        };
        let x = self.dense.forward(features, train);
        Logits { actions: precision::linear_f32(&self.actions, &x), objects: precision::linear_f32(&self.objects, &x) }
    }
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind};

    use super::*;
    use crate::nets::visual::SIDE;

    fn spec(goal: Option<[i64; 4]>) -> PolicySpec {
        PolicySpec {
            history: 5,
            embedding: 6,
            channels: [8; 4],
            downsample: false,
            hidden: vec![16],
            dropout: 0.2,
            goal_channels: goal,
            attention: None,
        }
    }

    #[test]
    fn weights_fit_a_network_of_their_size_whatever_is_dropped_in_training() {
        assert!(PolicySpec { dropout: 0.0, ..spec(None) }.fits(&spec(None)));
        assert!(!PolicySpec { history: 4, ..spec(None) }.fits(&spec(None)));
    }

    #[test]
    fn the_heads_have_12_and_82_entries_and_depend_on_the_sentence() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(1);
        let store = nn::VarStore::new(Device::Cpu);
        let net = PolicyNet::new(&store.root(), &spec(None), 4);
        let observation = Tensor::rand([2, 20, SIDE, SIDE], (Kind::Float, Device::Cpu));
        let say = |v: f32| Tensor::full([2, 6], f64::from(v), (Kind::Float, Device::Cpu));
        let one = net.forward(&observation, &say(0.4), false);
        let other = net.forward(&observation, &say(-0.4), false);
        assert_eq!((one.actions.size(), one.objects.size()), (vec![2, 12], vec![2, 82]));
        assert!((one.actions - other.actions).abs().max().double_value(&[]) > 1e-3);
    }

    #[test]
    fn a_goal_that_items_share_is_to_them_as_their_own_copy_of_it() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(3);
        let store = nn::VarStore::new(Device::Cpu);
        let policy = PolicyNet::new(&store.root(), &PolicySpec { dropout: 0.0, ..spec(Some([4; 4])) }, 2);
        let maps = |n: i64| Tensor::rand([n, 10, SIDE, SIDE], (Kind::Float, Device::Cpu));
        let (seen, goals) = (maps(4), maps(2));
        let rows = Tensor::from_slice(&[0i64, 1, 1, 0]);
        let shared = SharedRows { distinct: goals.shallow_clone(), rows: Some(rows.shallow_clone()) };
        for train in [true, false] {
            let together = policy.forward_shared(&SharedRows::own(&seen), &shared, train);
            let apart = policy.forward(&seen, &goals.index_select(0, &rows), train);
            assert!((together.actions - apart.actions).abs().max().double_value(&[]) < 1e-5, "{train}");
        }
    }

    #[test]
    fn a_policy_that_is_shown_its_goal_depends_on_it() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(1);
        let store = nn::VarStore::new(Device::Cpu);
        let net = PolicyNet::new(&store.root(), &spec(Some([4; 4])), 4);
        let frames = || Tensor::rand([2, 20, SIDE, SIDE], (Kind::Float, Device::Cpu));
        let observation = frames();
        let one = net.forward(&observation, &frames(), false);
        let other = net.forward(&observation, &frames(), false);
        assert!((one.actions - other.actions).abs().max().double_value(&[]) > 1e-4);
    }

    #[test]
    fn padding_says_nothing_to_a_policy_that_reads_words() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(1);
        let store = nn::VarStore::new(Device::Cpu);
        let attention = Some(AttentionSpec { vocabulary_size: 9, layers: 1, heads: 2, feedforward: 8 });
        let net = PolicyNet::new(&store.root(), &PolicySpec { attention, ..spec(None) }, 4);
        let observation = Tensor::rand([1, 20, SIDE, SIDE], (Kind::Float, Device::Cpu));
        let say = |words: &[i64]| net.forward(&observation, &Tensor::from_slice(words).unsqueeze(0), false).actions;
        let differs = |a: Tensor, b: Tensor| (a - b).abs().max().double_value(&[]) > 1e-4;
        assert!(differs(say(&[2, 3]), say(&[3, 2])), "the order of words matters");
        assert!(!differs(say(&[2, 3]), say(&[2, 3, 0, 0])));
    }
}
