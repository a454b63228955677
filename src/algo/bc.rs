//! Behaviour cloning: the losses of both heads.

use tch::{Kind, Tensor};

use crate::nets::policy::Logits;

/// A batch's losses; each a scalar tensor.
#[derive(Debug)]
pub struct BcLoss {
    /// Cross-entropy of the action head, averaged over the batch.
    pub action: Tensor,
    /// Cross-entropy of the object head, averaged over the interactions in the batch; 0 without any.
    pub object: Tensor,
}

impl BcLoss {
    /// Both, with equal weight.
    pub fn total(&self) -> Tensor {
        &self.action + &self.object
    }
}

/// How well `logits` tell the demonstrated `actions` [n] and `objects` [n] (class indices, 0 for navigation).
pub fn loss(logits: &Logits, actions: &Tensor, objects: &Tensor) -> BcLoss {
    let interaction = objects.gt(0).to_kind(Kind::Float);
    let surprise = |logits: &Tensor, labels: &Tensor| {
        -logits.log_softmax(-1, Kind::Float).gather(1, &labels.unsqueeze(1), false).squeeze_dim(1)
    };
    let count = interaction.sum(Kind::Float).clamp_min(1.0);
    BcLoss {
        action: surprise(&logits.actions, actions).mean(Kind::Float),
        object: (surprise(&logits.objects, objects) * interaction).sum(Kind::Float) / count,
    }
}

/// Shares of right answers: of the action head, and of the object head among interactions (1 without any).
pub fn accuracy(logits: &Logits, actions: &Tensor, objects: &Tensor) -> (f64, f64) {
    let right = |logits: &Tensor, labels: &Tensor| logits.argmax(-1, false).eq_tensor(labels).to_kind(Kind::Float);
    let interaction = objects.gt(0).to_kind(Kind::Float);
    let count = interaction.sum(Kind::Float).double_value(&[]);
    let named = (right(&logits.objects, objects) * interaction).sum(Kind::Float).double_value(&[]);
    let share = if count > 0.0 { named / count } else { 1.0 };
    (right(&logits.actions, actions).mean(Kind::Float).double_value(&[]), share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn logits(actions: [[f32; 3]; 2], objects: [[f32; 2]; 2]) -> Logits {
        Logits { actions: Tensor::from_slice2(&actions), objects: Tensor::from_slice2(&objects) }
    }

    #[test]
    fn the_loss_by_hand() {
        let e = std::f32::consts::E;
        let logits = logits([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[9.0, -9.0], [0.0, 1.0]]);
        let (actions, objects) = (Tensor::from_slice(&[2i64, 0]), Tensor::from_slice(&[0i64, 1]));
        let loss = loss(&logits, &actions, &objects);
        let expected = (3f32.ln() + (1.0 + 2.0 / e).ln()) / 2.0;
        assert!((loss.action.double_value(&[]) - f64::from(expected)).abs() < 1e-6);
        // Only the second is an interaction, so the first's object logits do not count.
        let expected = (1.0 + 1.0 / e).ln();
        assert!((loss.object.double_value(&[]) - f64::from(expected)).abs() < 1e-6);
        assert_eq!(accuracy(&logits, &actions, &objects), (0.5, 1.0));
    }

    #[test]
    fn a_batch_without_interactions_has_no_object_loss() {
        let logits = logits([[0.0; 3]; 2], [[1.0, 2.0]; 2]);
        let zeros = Tensor::from_slice(&[0i64, 0]);
        assert_eq!(loss(&logits, &zeros, &zeros).object.double_value(&[]), 0.0);
    }
}
