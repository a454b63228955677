//! Behaviour cloning: the negative log-likelihood of demonstrations under both heads. IQL's policy extraction weighs the same
//! terms.

use tch::{Kind, Tensor};

use crate::nets::policy::Logits;

/// −log π of each item's demonstration, both `[n]`.
#[derive(Debug)]
pub(crate) struct NegLogLikelihood {
    /// Cross-entropy of the action head.
    pub(crate) action: Tensor,
    /// Cross-entropy of the object head; 0 where there is no class to learn.
    pub(crate) object: Tensor,
}

/// Of the demonstrated `actions` [n] and the classes `object_target` [n] (indices, 0 for none) under `logits`.
pub(crate) fn neg_log_likelihood(logits: &Logits, actions: &Tensor, object_target: &Tensor) -> NegLogLikelihood {
    let of = |logits: &Tensor, labels: &Tensor| {
        -logits.log_softmax(-1, Kind::Float).gather(1, &labels.unsqueeze(1), false).squeeze_dim(1)
    };
    NegLogLikelihood {
        action: of(&logits.actions, actions),
        object: of(&logits.objects, object_target) * object_mask(object_target),
    }
}

/// 1 where there is a class to learn, [n].
pub(crate) fn object_mask(object_target: &Tensor) -> Tensor {
    object_target.gt(0).to_kind(Kind::Float)
}

/// Shares of right answers: of the action head, and of the object head among interactions (1 without any).
pub(crate) fn accuracy(logits: &Logits, actions: &Tensor, objects: &Tensor) -> (f64, f64) {
    let right = |logits: &Tensor, labels: &Tensor| logits.argmax(-1, false).eq_tensor(labels).to_kind(Kind::Float);
    let interaction = object_mask(objects);
    let count = interaction.sum(Kind::Float).double_value(&[]);
    let right_objects = (right(&logits.objects, objects) * interaction).sum(Kind::Float).double_value(&[]);
    let share = if count > 0.0 { right_objects / count } else { 1.0 };
    (right(&logits.actions, actions).mean(Kind::Float).double_value(&[]), share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn logits(actions: [[f32; 3]; 2], objects: [[f32; 2]; 2]) -> Logits {
        Logits { actions: Tensor::from_slice2(&actions), objects: Tensor::from_slice2(&objects) }
    }

    #[test]
    fn the_negative_log_likelihood_by_hand() {
        let e = std::f32::consts::E;
        let logits = logits([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[9.0, -9.0], [0.0, 1.0]]);
        let (actions, objects) = (Tensor::from_slice(&[2i64, 0]), Tensor::from_slice(&[0i64, 1]));
        let nll = neg_log_likelihood(&logits, &actions, &objects);
        let close = |found: &Tensor, expected: [f32; 2]| {
            let found = Vec::<f32>::try_from(found).unwrap();
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
        };
        close(&nll.action, [3f32.ln(), (1.0 + 2.0 / e).ln()]);
        // Only the second is an interaction, so the first's object logits do not count.
        close(&nll.object, [0.0, (1.0 + 1.0 / e).ln()]);
        assert_eq!(accuracy(&logits, &actions, &objects), (0.5, 1.0));
    }
}
