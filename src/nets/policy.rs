//! The policy network: a convolutional trunk over stacked feature maps, modulated by the sentence, and two heads.

use serde::{Deserialize, Serialize};
use tch::Tensor;
use tch::nn::{self, Module, ModuleT};

use super::film::Film;
use super::visual::SIDE;
use crate::domain::{ActionType, Class};

/// The size of a policy network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicySpec {
    /// Frames in an observation, the present one last.
    pub history: i64,
    /// Numbers in a sentence embedding.
    pub embedding: i64,
    /// Channels of the four convolutions; the first is 1 x 1, the others 3 x 3.
    pub channels: [i64; 4],
    /// Width of the fully connected layers.
    pub hidden: Vec<i64>,
    /// Share of the fully connected units that is dropped in training.
    pub dropout: f64,
}

/// Logits of both heads.
#[derive(Debug)]
pub struct Logits {
    /// [n, 12]: what to do.
    pub actions: Tensor,
    /// [n, 82]: to which class; entry 0 is `None`.
    pub objects: Tensor,
}

/// Sees the last few frames and a sentence; says what to do and to which class.
#[derive(Debug)]
pub struct PolicyNet {
    spec: PolicySpec,
    convs: Vec<(nn::Conv2D, nn::BatchNorm, Film)>,
    dense: Vec<nn::Linear>,
    actions: nn::Linear,
    objects: nn::Linear,
}

impl PolicyNet {
    /// A network with fresh weights under `path`, over maps of `features` channels a frame.
    pub fn new(path: &nn::Path<'_>, spec: &PolicySpec, features: i64) -> PolicyNet {
        let mut from = spec.history * features;
        let mut convs = Vec::new();
        for (i, &to) in spec.channels.iter().enumerate() {
            let here = path / format!("conv{}", i + 1);
            let (kernel, padding) = if i == 0 { (1, 0) } else { (3, 1) };
            let config = nn::ConvConfig { padding, bias: false, ..Default::default() };
            convs.push((
                nn::conv2d(&here / "conv", from, to, kernel, config),
                nn::batch_norm2d(&here / "norm", to, Default::default()),
                Film::new(&(&here / "film"), spec.embedding, to),
            ));
            from = to;
        }
        let mut width = from * SIDE * SIDE + spec.embedding;
        let mut dense = Vec::new();
        for (i, &to) in spec.hidden.iter().enumerate() {
            dense.push(nn::linear(path / format!("dense{}", i + 1), width, to, Default::default()));
            width = to;
        }
        PolicyNet {
            convs,
            dense,
            actions: nn::linear(path / "actions", width, ActionType::COUNT as i64, Default::default()),
            objects: nn::linear(path / "objects", width, Class::VOCABULARY as i64, Default::default()),
            spec: spec.clone(),
        }
    }

    /// Its size.
    pub fn spec(&self) -> &PolicySpec {
        &self.spec
    }

    /// `observation` [n, history * features, 7, 7], oldest frame first, and `sentence` [n, embedding], of unit length.
    pub fn forward(&self, observation: &Tensor, sentence: &Tensor, train: bool) -> Logits {
        // A unit vector's entries are tiny; scaled to unit variance they weigh as much as the other features.
        let sentence = sentence * (self.spec.embedding as f64).sqrt();
        let mut x = observation.shallow_clone();
        for (conv, norm, film) in &self.convs {
            x = film.forward(&norm.forward_t(&x.apply(conv), train), &sentence).relu();
        }
        let mut x = Tensor::cat(&[x.flatten(1, -1), sentence], 1);
        for dense in &self.dense {
            x = dense.forward(&x).relu().dropout(self.spec.dropout, train);
        }
        Logits { actions: self.actions.forward(&x), objects: self.objects.forward(&x) }
    }
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind};

    use super::*;

    #[test]
    fn the_heads_have_12_and_82_entries_and_depend_on_the_sentence() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(1);
        let store = nn::VarStore::new(Device::Cpu);
        let spec = PolicySpec { history: 5, embedding: 6, channels: [8; 4], hidden: vec![16], dropout: 0.2 };
        let net = PolicyNet::new(&store.root(), &spec, 4);
        let observation = Tensor::rand([2, 20, SIDE, SIDE], (Kind::Float, Device::Cpu));
        let say = |v: f32| Tensor::full([2, 6], f64::from(v), (Kind::Float, Device::Cpu));
        let one = net.forward(&observation, &say(0.4), false);
        let other = net.forward(&observation, &say(-0.4), false);
        assert_eq!((one.actions.size(), one.objects.size()), (vec![2, 12], vec![2, 82]));
        assert!((one.actions - other.actions).abs().max().double_value(&[]) > 1e-3);
    }
}
