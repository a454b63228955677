//! What policy and critic have in common: the convolutional trunk over stacked feature maps, modulated by the conditioning,
//! and the fully connected layers above it.

use tch::nn::{self, ModuleT};
use tch::{Kind, Tensor};

use super::film::Film;
use super::precision;
use super::shared_rows::SharedRows;
use super::visual::SIDE;

/// The convolutions of a trunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Convolutions<'a> {
    /// Output channels of each.
    pub(crate) channels: &'a [i64; 4],
    /// Whether the second one reads every other place, so that those after it see 4 x 4 places instead of 7 x 7.
    pub(crate) downsample: bool,
}

impl Convolutions<'_> {
    /// How far apart the places are that the convolution at a position reads.
    fn stride(self, position: usize) -> i64 {
        if self.downsample && position == 1 { 2 } else { 1 }
    }

    /// The side of the map that comes out.
    fn side(self) -> i64 {
        if self.downsample { (SIDE + 1) / 2 } else { SIDE }
    }
}

/// Four convolutions, the first 1 x 1, the others 3 x 3, each with batch norm, FiLM and ReLU.
#[derive(Debug)]
pub(crate) struct Trunk {
    stages: Vec<TrunkStage>,
    width: i64,
}

#[derive(Debug)]
struct TrunkStage {
    conv: nn::Conv2D,
    stride: i64,
    norm: nn::BatchNorm,
    film: Option<Film>,
}

impl Trunk {
    /// A trunk over `from` channels with fresh weights under `path`; `conditioning` is the width of the vector that modulates it, if
    /// there is one. Norms begin with scales by chance between 0 and 1: where they began at 1, a clone had a held-out action loss
    /// of 0.66 after 2,000 updates instead of 0.64.
    pub(crate) fn new(
        path: &nn::Path<'_>,
        from: i64,
        convolutions: Convolutions<'_>,
        conditioning: Option<i64>,
    ) -> Trunk {
        let mut from = from;
        let mut stages = Vec::new();
        for (i, &to) in convolutions.channels.iter().enumerate() {
            let here = path / format!("conv{}", i + 1);
            let (kernel, padding) = if i == 0 { (1, 0) } else { (3, 1) };
            let stride = convolutions.stride(i);
            let config = nn::ConvConfig { padding, stride, bias: false, ..Default::default() };
            stages.push(TrunkStage {
                conv: nn::conv2d(&here / "conv", from, to, kernel, config),
                stride,
                norm: nn::batch_norm2d(&here / "norm", to, Default::default()),
                film: conditioning.map(|width| Film::new(&(&here / "film"), width, to)),
            });
            from = to;
        }
        Trunk { stages, width: from * convolutions.side().pow(2) }
    }

    /// Features of an item.
    pub(crate) fn width(&self) -> i64 {
        self.width
    }

    /// `observation` [n, channels, 7, 7] and `conditioning` [n, width] in numbers of one width, to [n, [`Trunk::width`]].
    pub(crate) fn forward(&self, observation: &Tensor, conditioning: Option<&Tensor>, train: bool) -> Tensor {
        self.forward_shared(&SharedRows::own(observation), conditioning, train)
    }

    /// The same of items that may share observations: the first convolution is computed once for each.
    pub(crate) fn forward_shared(
        &self,
        observations: &SharedRows,
        conditioning: Option<&Tensor>,
        train: bool,
    ) -> Tensor {
        let mut x = observations.distinct.shallow_clone();
        for (position, TrunkStage { conv, stride, norm, film }) in self.stages.iter().enumerate() {
            x = precision::convolution(conv, &x, *stride);
            if position == 0 {
                x = observations.for_items(x);
            }
            x = norm.forward_t(&x, train);
            if let (Some(film), Some(conditioning)) = (film, conditioning) {
                x = film.forward(&x, conditioning);
            }
            x = x.relu_();
        }
        x.flatten(1, -1)
    }
}

/// Fully connected layers with ReLU and dropout, named `dense1`, `dense2` and so on.
#[derive(Debug)]
pub(crate) struct DenseLayers {
    layers: Vec<nn::Linear>,
    dropout: f64,
    width: i64,
}

impl DenseLayers {
    /// Layers of widths `hidden` over `from` numbers with fresh weights under `path`.
    pub(crate) fn new(path: &nn::Path<'_>, from: i64, hidden: &[i64], dropout: f64) -> DenseLayers {
        let mut width = from;
        let mut layers = Vec::new();
        for (i, &to) in hidden.iter().enumerate() {
            layers.push(nn::linear(path / format!("dense{}", i + 1), width, to, Default::default()));
            width = to;
        }
        DenseLayers { layers, dropout, width }
    }

    /// Features of an item.
    pub(crate) fn width(&self) -> i64 {
        self.width
    }

    /// `x` [n, from] to [n, [`DenseLayers::width`]].
    pub(crate) fn forward(&self, x: Tensor, train: bool) -> Tensor {
        self.layers.iter().fold(x, |x, layer| precision::linear(layer, &x).relu_().dropout(self.dropout, train))
    }
}

/// Turns an instruction or a goal into the vector that modulates the trunk and joins its features.
#[derive(Debug)]
pub(crate) enum Conditioning {
    /// A sentence embedding of unit length.
    Sentence { width: i64 },
    /// Actionable Models: the stack of frames of the state to reach, seen by convolutions of its own.
    Goal {
        /// Convolutions over the goal's maps.
        trunk: Trunk,
        /// From their features to as many numbers as a sentence would have.
        out: nn::Linear,
    },
}

impl Conditioning {
    /// For sentences of `width` numbers, or with `goal`, its convolutions, for stacks of `from` channels.
    pub(crate) fn new(path: &nn::Path<'_>, width: i64, goal: Option<Convolutions<'_>>, from: i64) -> Conditioning {
        let Some(convolutions) = goal else { return Conditioning::Sentence { width } };
        let path = path / "goal";
        let trunk = Trunk::new(&path, from, convolutions, None);
        let out = nn::linear(&path / "out", trunk.width(), width, Default::default());
        Conditioning::Goal { trunk, out }
    }

    /// The vectors of all items, [items, width]: each goal is seen once, however many items share it.
    pub(crate) fn for_items(&self, conditioning: &SharedRows, kind: Kind, train: bool) -> Tensor {
        conditioning.for_items(self.forward(&conditioning.distinct, kind, train))
    }

    /// `conditioning`, sentences [n, width] or goals [n, channels, 7, 7], to [n, width], as wide as `kind` says.
    pub(crate) fn forward(&self, conditioning: &Tensor, kind: Kind, train: bool) -> Tensor {
        match self {
            // A unit vector's entries are tiny; scaled to unit variance they weigh as much as the other features.
            Conditioning::Sentence { width } => (conditioning * (*width as f64).sqrt()).to_kind(kind),
            Conditioning::Goal { trunk, out } => {
                precision::linear(out, &trunk.forward(&conditioning.to_kind(kind), None, train)).tanh()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tch::Device;

    use super::*;

    #[test]
    fn a_halved_trunk_gives_four_by_four_places_and_still_sees_all_of_the_map() {
        let _chance = crate::nets::testing::chance();
        tch::manual_seed(6);
        let widths = [false, true].map(|downsample| {
            let store = nn::VarStore::new(Device::Cpu);
            let trunk = Trunk::new(&store.root(), 2, Convolutions { channels: &[16; 4], downsample }, None);
            let corner = Tensor::zeros([1, 2, SIDE, SIDE], (Kind::Float, Device::Cpu));
            let dark = trunk.forward(&corner, None, false);
            let _ = corner.select(2, SIDE - 1).select(2, SIDE - 1).fill_(9.0);
            assert_eq!(dark.size(), [1, trunk.width()]);
            assert!(trunk.forward(&corner, None, false) != dark, "the last place matters");
            trunk.width()
        });
        assert_eq!(widths, [16 * 7 * 7, 16 * 4 * 4]);
    }
}
