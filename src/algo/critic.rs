//! The critic under training: what it makes of a batch, and what it learns from that.

use std::collections::BTreeMap;

use tch::{Kind, Tensor, nn};

use super::batch::{AGG_A, CHAIN, Segment, Transitions};
use super::chain::{self, Bootstrap, Chaining, RewardDone};
use super::iql::{self, Iql, PolyakTarget};
use super::learner::{Learner, Optimisation};
use super::terms::Terms;
use crate::nets::critic::{Critic, CriticValues};
use crate::nets::weights::{self, Tensors};

/// The critic under training.
pub struct CriticLearner<'a> {
    online: &'a Critic,
    target: &'a Critic,
    target_store: &'a nn::VarStore,
    learner: Learner<'a>,
    tracking: PolyakTarget,
    iql: Iql,
}

impl<'a> CriticLearner<'a> {
    /// A critic with its optimiser, and the target that follows it; both at step 0.
    pub fn new(
        (online, store): (&'a Critic, &'a nn::VarStore),
        (target, target_store): (&'a Critic, &'a nn::VarStore),
        optimisation: Optimisation,
        iql: Iql,
        seed: u64,
    ) -> CriticLearner<'a> {
        let mut tracking = PolyakTarget::new(store, target_store);
        tracking.follow(1.0);
        CriticLearner { online, target, target_store, learner: Learner::new(store, optimisation, seed), tracking, iql }
    }

    /// Whether it knows too little to weigh a policy's surprise.
    pub(super) fn is_warming_up(&self) -> bool {
        self.learner.share() < self.iql.warmup_share
    }

    /// One step down `loss`; the target follows.
    pub(super) fn minimise(&mut self, loss: &Tensor) {
        self.learner.minimise(loss);
        self.tracking.follow(self.iql.target_rate);
    }

    /// Every tensor of the training's state, by name.
    pub(super) fn state(&self) -> Tensors {
        let mut tensors = weights::prefixed("critic.", self.learner.state());
        tensors.extend(weights::prefixed("target.", self.target_store.variables().into_iter().collect()));
        tensors
    }

    /// Takes up a state that was saved after `step` steps.
    ///
    /// # Errors
    /// When a tensor cannot be taken over.
    pub(super) fn restore(&mut self, step: u64, tensors: &Tensors) -> anyhow::Result<()> {
        self.learner.restore(step, &weights::under("critic.", tensors))?;
        weights::copy(tensors, "target.", self.target_store)
    }

    /// What it makes of them now.
    pub(super) fn evaluate(&self, all: &Transitions, parts: &[Segment], chaining: Option<&Chaining>) -> Judged {
        let next = all.next.as_ref().unwrap_or(&all.observation);
        let target_q = self.target.min_q(&all.observation, &all.told, &all.actions, &all.objects);
        let next_value = self.online.value(next, &all.told);
        let judgement = self.online.evaluate(&all.observation, &all.told, &all.actions, &all.objects);
        let worth = parts.iter().find(|part| part.name == CHAIN).zip(chaining).map(|(part, chaining)| {
            let worth = match chaining.worth {
                Bootstrap::NextValue => part.of(&next_value),
                Bootstrap::PresentValue => part.of(&judgement.baseline),
                Bootstrap::TargetQ => part.of(&target_q),
            };
            chain::as_reward(&worth, chaining.clip)
        });
        let rewards: Vec<Tensor> = parts
            .iter()
            .map(|part| match (part.name, &worth) {
                (CHAIN | AGG_A, Some(worth)) => RewardDone::chained(&part.of(&all.terminal), worth).reward,
                _ => RewardDone::of_skill(&part.of(&all.terminal)).reward,
            })
            .collect();
        let bootstrap = iql::q_target(&Tensor::cat(&rewards, 0), &all.terminal, &next_value, self.iql.discount);
        let weights = iql::advantage_weights(&target_q, &judgement.baseline, self.iql.temperature, self.iql.weight_cap);
        let taken = all.taken.shallow_clone();
        Judged { judgement, target_q, bootstrap, weights, taken, expectile: self.iql.expectile }
    }
}

/// What the critic makes of all items.
pub(super) struct Judged {
    judgement: CriticValues,
    /// min Q̄.
    target_q: Tensor,
    /// r + (1 − d) γ V(s′).
    bootstrap: Tensor,
    /// exp(β (Q − V)), capped: what a policy's surprise at each item weighs.
    pub weights: Tensor,
    taken: Tensor,
    expectile: f64,
}

impl Judged {
    /// The losses of V and both Q, averaged part by part over what was taken, and weighed: what would have been right led
    /// nowhere, so the policy alone learns from it.
    pub fn loss(&self, parts: &[Segment], terms: &mut Terms) -> Tensor {
        let value = iql::value_loss(&self.judgement.value, &self.target_q, self.expectile);
        let [one, other] = [0, 1].map(|k| iql::q_loss(&self.judgement.q[k], &self.bootstrap));
        let q = one + other;
        let part_loss = |part: &Segment| {
            let taken = part.of(&self.taken);
            let count = taken.sum(Kind::Float).clamp_min(1.0);
            let [value, q] = [&value, &q].map(|loss| (part.of(loss) * &taken).sum(Kind::Float) / &count);
            terms.add(part.label("value_loss"), &value);
            terms.add(part.label("q_loss"), &q);
            (value + q) * part.weight
        };
        parts.iter().map(part_loss).sum()
    }

    /// Weights and values, those of chaining by their parts' names.
    pub fn describe(&self, parts: &[Segment], numbers: &mut BTreeMap<String, f64>) {
        let value = &self.judgement.baseline;
        for part in parts {
            let found = [
                ("weight_mean", part.of(&self.weights).mean(Kind::Double)),
                ("weight_max", part.of(&self.weights).max().to_kind(Kind::Double)),
                ("q_mean", part.of(&self.target_q).mean(Kind::Double)),
                ("v_mean", part.of(value).mean(Kind::Double)),
            ];
            numbers.extend(found.map(|(name, tensor)| (part.label(name), tensor.double_value(&[]))));
        }
    }
}
