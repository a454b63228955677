//! The visual encoder's training heads: classes and states of each place (cell labels), depth, and the held class.

use tch::nn::{self, Module};
use tch::{Kind, Reduction, Tensor};

use super::visual::SIDE;
use crate::domain::Class;

/// Heads over a feature map; thrown away after training.
#[derive(Debug)]
pub(crate) struct PerceptionHeads {
    cell_labels: nn::Conv2D,
    depth: nn::Conv2D,
    held: nn::Linear,
}

/// A batch's losses; each a scalar tensor.
#[derive(Debug)]
pub(crate) struct PerceptionLoss {
    /// Binary cross-entropy of the cell labels, added up over those of a place.
    pub(crate) cell_labels: Tensor,
    /// Mean absolute error of the logarithm of depth.
    pub(crate) depth: Tensor,
    /// Cross-entropy of the held class.
    pub(crate) held: Tensor,
}

impl PerceptionLoss {
    /// The sum, unweighted.
    pub(crate) fn total(&self) -> Tensor {
        &self.cell_labels + &self.depth + &self.held
    }
}

/// The labels of a batch of frames.
#[derive(Debug)]
pub(crate) struct FrameLabels {
    /// [n, labels of a cell, 7, 7], 0 or 1.
    pub(crate) cell_labels: Tensor,
    /// [n, 1, 7, 7], the logarithm of metres.
    pub(crate) depth: Tensor,
    /// `[n]`, class indices.
    pub(crate) held: Tensor,
}

impl PerceptionHeads {
    /// Heads for that many labels of a cell, over maps of `features` channels.
    pub(crate) fn new(path: &nn::Path<'_>, features: i64, cell_labels: i64) -> PerceptionHeads {
        PerceptionHeads {
            cell_labels: nn::conv2d(path / "cell_labels", features, cell_labels, 1, Default::default()),
            depth: nn::conv2d(path / "depth", features, 1, 1, Default::default()),
            held: nn::linear(path / "held", features * SIDE * SIDE, Class::VOCABULARY as i64, Default::default()),
        }
    }

    /// How far `maps` are from the `labels`. A label that holds weighs `positive_weight` times one that does not.
    pub(crate) fn loss(&self, maps: &Tensor, labels: &FrameLabels, positive_weight: f64) -> PerceptionLoss {
        let logits = maps.apply(&self.cell_labels);
        let weight = Tensor::from(positive_weight as f32).to_device(logits.device());
        let cell_loss = logits.binary_cross_entropy_with_logits(
            &labels.cell_labels,
            None::<&Tensor>,
            Some(&weight),
            Reduction::Mean,
        );
        PerceptionLoss {
            cell_labels: cell_loss * logits.size()[1],
            depth: (maps.apply(&self.depth) - &labels.depth).abs().mean(Kind::Float),
            held: self.held.forward(&maps.flatten(1, -1)).cross_entropy_for_logits(&labels.held),
        }
    }

    /// Of the cell labels `from..to`: how many hold and are predicted, hold, are predicted; and how many held classes are right.
    pub(crate) fn counts(&self, maps: &Tensor, labels: &FrameLabels, from: i64, to: i64) -> [f64; 4] {
        let predicted = maps.apply(&self.cell_labels).gt(0.0).to_kind(Kind::Float).narrow(1, from, to - from);
        let holds = labels.cell_labels.narrow(1, from, to - from);
        let held = self.held.forward(&maps.flatten(1, -1)).argmax(-1, false).eq_tensor(&labels.held);
        [&predicted * &holds, holds, predicted, held.to_kind(Kind::Float)]
            .map(|tensor| tensor.sum(Kind::Float).double_value(&[]))
    }
}
