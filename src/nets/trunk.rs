//! What policy and critic have in common: the convolutional trunk over stacked feature maps, modulated by what the agent is
//! told, and the fully connected layers above it.

use tch::Tensor;
use tch::nn::{self, Module, ModuleT};

use super::film::Film;
use super::visual::SIDE;

/// Four convolutions, the first 1 x 1, the others 3 x 3, each with batch norm, FiLM and ReLU.
#[derive(Debug)]
pub struct Trunk {
    convs: Vec<(nn::Conv2D, nn::BatchNorm, Option<Film>)>,
    width: i64,
}

impl Trunk {
    /// A trunk over `from` channels with fresh weights under `path`; `told` is the width of the vector that modulates it, if
    /// there is one.
    pub fn new(path: &nn::Path<'_>, from: i64, channels: &[i64; 4], told: Option<i64>) -> Trunk {
        let mut from = from;
        let mut convs = Vec::new();
        for (i, &to) in channels.iter().enumerate() {
            let here = path / format!("conv{}", i + 1);
            let (kernel, padding) = if i == 0 { (1, 0) } else { (3, 1) };
            let config = nn::ConvConfig { padding, bias: false, ..Default::default() };
            convs.push((
                nn::conv2d(&here / "conv", from, to, kernel, config),
                nn::batch_norm2d(&here / "norm", to, Default::default()),
                told.map(|width| Film::new(&(&here / "film"), width, to)),
            ));
            from = to;
        }
        Trunk { convs, width: from * SIDE * SIDE }
    }

    /// How many numbers come out.
    pub fn width(&self) -> i64 {
        self.width
    }

    /// `observation` [n, channels, 7, 7] and `told` [n, width] to [n, [`Trunk::width`]].
    pub fn forward(&self, observation: &Tensor, told: Option<&Tensor>, train: bool) -> Tensor {
        let mut x = observation.shallow_clone();
        for (conv, norm, film) in &self.convs {
            x = norm.forward_t(&x.apply(conv), train);
            if let (Some(film), Some(told)) = (film, told) {
                x = film.forward(&x, told);
            }
            x = x.relu_();
        }
        x.flatten(1, -1)
    }
}

/// Fully connected layers with ReLU and dropout, named `dense1`, `dense2` and so on.
#[derive(Debug)]
pub struct Dense {
    layers: Vec<nn::Linear>,
    dropout: f64,
    width: i64,
}

impl Dense {
    /// Layers of widths `hidden` over `from` numbers with fresh weights under `path`.
    pub fn new(path: &nn::Path<'_>, from: i64, hidden: &[i64], dropout: f64) -> Dense {
        let mut width = from;
        let mut layers = Vec::new();
        for (i, &to) in hidden.iter().enumerate() {
            layers.push(nn::linear(path / format!("dense{}", i + 1), width, to, Default::default()));
            width = to;
        }
        Dense { layers, dropout, width }
    }

    /// How many numbers come out.
    pub fn width(&self) -> i64 {
        self.width
    }

    /// `x` [n, from] to [n, [`Dense::width`]].
    pub fn forward(&self, x: Tensor, train: bool) -> Tensor {
        self.layers.iter().fold(x, |x, layer| layer.forward(&x).relu_().dropout(self.dropout, train))
    }
}

/// What the agent is told, as the vector that modulates and joins the features.
#[derive(Debug)]
pub enum Telling {
    /// A sentence embedding of unit length.
    Sentence {
        /// Its width.
        width: i64,
    },
    /// Actionable Models: the stack of frames of the state to reach, seen by convolutions of its own.
    Goal {
        /// Sees.
        trunk: Trunk,
        /// From what is seen to as many numbers as a sentence would have.
        out: nn::Linear,
    },
}

impl Telling {
    /// For sentences of `width` numbers, or with `goal`, the channels of its convolutions, for stacks of `from` channels.
    pub fn new(path: &nn::Path<'_>, width: i64, goal: Option<&[i64; 4]>, from: i64) -> Telling {
        let Some(channels) = goal else { return Telling::Sentence { width } };
        let path = path / "goal";
        let trunk = Trunk::new(&path, from, channels, None);
        let out = nn::linear(&path / "out", trunk.width(), width, Default::default());
        Telling::Goal { trunk, out }
    }

    /// `told`, sentences [n, width] or goals [n, channels, 7, 7], to [n, width].
    pub fn forward(&self, told: &Tensor, train: bool) -> Tensor {
        match self {
            // A unit vector's entries are tiny; scaled to unit variance they weigh as much as the other features.
            Telling::Sentence { width } => told * (*width as f64).sqrt(),
            Telling::Goal { trunk, out } => out.forward(&trunk.forward(told, None, train)).tanh(),
        }
    }
}
