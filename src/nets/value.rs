//! V(s, z): the head that says how likely the instruction will be fulfilled from here.

use tch::Tensor;
use tch::nn;

use super::precision;
use super::trunk::DenseLayers;

/// Fully connected layers over a trunk's features and the conditioning, down to one number.
#[derive(Debug)]
pub(crate) struct ValueHead {
    dense: DenseLayers,
    out: nn::Linear,
}

impl ValueHead {
    /// A head over `from` numbers with fresh weights under `path`.
    pub(crate) fn new(path: &nn::Path<'_>, from: i64, hidden: &[i64], dropout: f64) -> ValueHead {
        let dense = DenseLayers::new(path, from, hidden, dropout);
        ValueHead { out: nn::linear(path / "out", dense.width(), 1, Default::default()), dense }
    }

    /// `input` [n, from] to `[n]`.
    pub(crate) fn forward(&self, input: &Tensor, train: bool) -> Tensor {
        precision::linear_f32(&self.out, &self.dense.forward(input.shallow_clone(), train)).squeeze_dim(1)
    }
}
