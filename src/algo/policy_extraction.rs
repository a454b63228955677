//! Policy extraction: the policy clones actions, weighed by advantages (IQL), from demonstrated and chained items.

use tch::{Kind, Tensor};

use super::batch::{CHAIN, Segment, Transitions, gather, gather_conditionings, gather_observations};
use super::bc;
use super::chain::{BatchNormStatistics, Chaining, PolicyExtraction};
use super::loss_terms::LossTerms;
use crate::nets::policy::Logits;
use crate::nets::shared_rows::SharedRows;

/// Segments that go through the policy in one forward pass.
pub(super) struct ForwardPass<'a> {
    segments: Vec<&'a Segment>,
    /// Whether batch norms use and keep up the batch's own statistics, and units are dropped.
    pub(crate) train: bool,
}

impl<'a> ForwardPass<'a> {
    /// What the policy learns from: the demonstrated items, the first of `segments`, and of the others what `chaining` says.
    pub(crate) fn all(segments: &'a [Segment], chaining: Option<&Chaining>) -> Vec<ForwardPass<'a>> {
        let (base, rest) = segments.split_at(1);
        let mut passes = vec![ForwardPass { segments: base.iter().collect(), train: true }];
        let Some(chaining) = chaining else { return passes };
        let kept =
            rest.iter().filter(|segment| chaining.policy_extraction == PolicyExtraction::Both || segment.name != CHAIN);
        match chaining.batch_norm_statistics {
            BatchNormStatistics::WholeBatch => passes[0].segments.extend(kept),
            BatchNormStatistics::Demonstrations => passes.push(ForwardPass { segments: kept.collect(), train: false }),
        }
        passes.retain(|pass| !pass.segments.is_empty());
        passes
    }

    /// The observations of its segments.
    pub(crate) fn observations(&self, all: &Transitions) -> SharedRows {
        gather_observations(&self.segments, all)
    }

    /// What its segments are conditioned on.
    pub(crate) fn conditionings(&self, all: &Transitions) -> SharedRows {
        gather_conditionings(&self.segments, all)
    }

    /// The items of its segments.
    pub(crate) fn of(&self, all: &Tensor) -> Tensor {
        gather(&self.segments, all)
    }
}

/// −w log π over both heads, w being 1 without `weights` (behaviour cloning): the action head's is averaged over a segment's
/// items, the object head's over those with a class to learn.
pub(super) fn loss(
    logits: &Logits,
    all: &Transitions,
    pass: &ForwardPass<'_>,
    weights: Option<&Tensor>,
    terms: &mut LossTerms,
) -> Tensor {
    let weigh = |nll: Tensor| weights.map_or_else(|| nll.shallow_clone(), |weights| &nll * pass.of(weights));
    let object_target = pass.of(&all.object_target);
    let bc::NegLogLikelihood { action, object } =
        bc::neg_log_likelihood(logits, &pass.of(&all.actions), &object_target);
    let (action, object, object_mask) = (weigh(action), weigh(object), bc::object_mask(&object_target));
    let mut start = 0;
    let segment_loss = |segment: &&Segment| {
        let of = |numbers: &Tensor| numbers.narrow(0, start, segment.len());
        let action = of(&action).mean(Kind::Float);
        let object = of(&object).sum(Kind::Float) / of(&object_mask).sum(Kind::Float).clamp_min(1.0);
        start += segment.len();
        terms.add(segment.label("action_loss"), &action);
        terms.add(segment.label("object_loss"), &object);
        (action + object) * segment.weight
    };
    pass.segments.iter().map(segment_loss).sum()
}
