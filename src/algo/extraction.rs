//! Policy extraction: the policy learns what was done, weighed by advantages (IQL), from demonstrated and chained items.

use tch::{Kind, Tensor};

use super::batch::{CHAIN, Segment, Transitions, of_all};
use super::bc;
use super::chain::{Chaining, Extracted, Normalised};
use super::terms::Terms;
use crate::nets::policy::Logits;

/// Parts that go through the policy together.
pub(super) struct Pass<'a> {
    parts: Vec<&'a Segment>,
    /// Whether they are normalised by their own statistics, these are kept up, and units are dropped.
    pub train: bool,
}

impl<'a> Pass<'a> {
    /// What the policy learns from: the demonstrated items, the first of `parts`, and of the others what `chaining` says.
    pub fn all(parts: &'a [Segment], chaining: Option<&Chaining>) -> Vec<Pass<'a>> {
        let (base, rest) = parts.split_at(1);
        let mut passes = vec![Pass { parts: base.iter().collect(), train: true }];
        let Some(chaining) = chaining else { return passes };
        let kept = rest.iter().filter(|part| chaining.extracted == Extracted::Both || part.name != CHAIN);
        match chaining.normalised {
            Normalised::Together => passes[0].parts.extend(kept),
            Normalised::ByDemonstrations => passes.push(Pass { parts: kept.collect(), train: false }),
        }
        passes.retain(|pass| !pass.parts.is_empty());
        passes
    }

    /// The items of its parts.
    pub fn of(&self, all: &Tensor) -> Tensor {
        of_all(&self.parts, all)
    }
}

/// Weighted policy extraction over both heads: the action's surprise is averaged over a part's items, the object's over those
/// that name a class. Without weights, behaviour cloning.
pub(super) fn loss(
    logits: &Logits,
    all: &Transitions,
    pass: &Pass<'_>,
    weights: Option<&Tensor>,
    terms: &mut Terms,
) -> Tensor {
    let weigh =
        |surprise: Tensor| weights.map_or_else(|| surprise.shallow_clone(), |weights| &surprise * pass.of(weights));
    let named = pass.of(&all.named);
    let bc::NegLogLikelihood { action, object } = bc::surprise(logits, &pass.of(&all.actions), &named);
    let (action, object, naming) = (weigh(action), weigh(object), bc::naming(&named));
    let mut start = 0;
    let part_loss = |part: &&Segment| {
        let of = |numbers: &Tensor| numbers.narrow(0, start, part.len());
        let action = of(&action).mean(Kind::Float);
        let object = of(&object).sum(Kind::Float) / of(&naming).sum(Kind::Float).clamp_min(1.0);
        start += part.len();
        terms.add(part.label("action_loss"), &action);
        terms.add(part.label("object_loss"), &object);
        (action + object) * part.weight
    };
    pass.parts.iter().map(part_loss).sum()
}
