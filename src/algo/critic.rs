//! The critic under training: its values of a batch, and what it learns from them.

use std::collections::BTreeMap;

use tch::{Kind, Tensor, nn};

use super::batch::{AGG_A, CHAIN, Segment, Transitions};
use super::chain::{self, Bootstrap, Chaining, RewardDone};
use super::iql::{self, Iql, PolyakTarget};
use super::learner::{Learner, Optimisation};
use super::loss_terms::LossTerms;
use crate::nets::critic::{Critic, CriticValues};
use crate::nets::shared_rows::SharedRows;
use crate::nets::weights::{self, Tensors};

/// Twin Q and V, their target and their optimiser.
pub(crate) struct CriticLearner<'a> {
    online: &'a Critic,
    target: &'a Critic,
    target_store: &'a nn::VarStore,
    learner: Learner<'a>,
    polyak: PolyakTarget,
    iql: Iql,
}

impl<'a> CriticLearner<'a> {
    /// A critic at step 0; the target begins as its copy.
    pub(crate) fn new(
        (online, store): (&'a Critic, &'a nn::VarStore),
        (target, target_store): (&'a Critic, &'a nn::VarStore),
        optimisation: Optimisation,
        iql: Iql,
        seed: u64,
    ) -> CriticLearner<'a> {
        let mut polyak = PolyakTarget::new(store, target_store);
        polyak.update(1.0);
        CriticLearner { online, target, target_store, learner: Learner::new(store, optimisation, seed), polyak, iql }
    }

    /// Whether it is too young for its advantages to weigh the policy's loss.
    pub(super) fn is_warming_up(&self) -> bool {
        self.learner.share() < self.iql.cloning_fraction
    }

    /// The gradients of the losses of V and both Q, which share an optimiser and may share a trunk.
    pub(super) fn gradients(&self, loss: &Tensor) -> Vec<Tensor> {
        self.learner.gradients(loss)
    }

    /// One step of V and both Q.
    pub(super) fn update_v_and_q(&mut self, gradients: Vec<Tensor>) {
        self.learner.step_against(gradients);
    }

    /// Moves the target Q̄ towards Q.
    pub(super) fn update_target(&mut self) {
        self.polyak.update(self.iql.target_update_rate);
    }

    /// Every tensor of the training's state, by name.
    pub(super) fn state(&self) -> Tensors {
        let mut tensors = weights::prefixed("critic.", self.learner.state());
        tensors.extend(weights::prefixed("target.", self.target_store.variables().into_iter().collect()));
        tensors
    }

    /// Continues from a state that was saved after `step` steps.
    ///
    /// # Errors
    /// When a tensor cannot be taken over.
    pub(super) fn restore(&mut self, step: u64, tensors: &Tensors) -> anyhow::Result<()> {
        self.learner.restore(step, &weights::under("critic.", tensors))?;
        weights::copy(tensors, "target.", self.target_store)
    }

    /// Its values of all items, with what V, both Q and the policy learn from them.
    pub(super) fn evaluate(&self, all: &Transitions, segments: &[Segment], chaining: Option<&Chaining>) -> CriticBatch {
        let of_items = |maps: &Tensor| SharedRows {
            distinct: maps.shallow_clone(),
            rows: all.rows.as_ref().map(Tensor::shallow_clone),
        };
        let (seen, next) = (of_items(&all.observation), of_items(all.next.as_ref().unwrap_or(&all.observation)));
        let target_q = self.target.min_q(&seen, &all.conditioning, &all.actions, &all.objects);
        let next_value = self.online.value(&next, &all.conditioning);
        let values = self.online.evaluate(&seen, &all.conditioning, &all.actions, &all.objects);
        let chained = segments.iter().find(|segment| segment.name == CHAIN).zip(chaining);
        let bootstrap = chained.map(|(segment, chaining)| {
            chain::as_reward(&match chaining.bootstrap {
                Bootstrap::NextValue => segment.of(&next_value),
                Bootstrap::TargetQ => segment.of(&target_q),
            })
        });
        let reward = |segment: &Segment| {
            let terminal = segment.of(&all.terminal);
            match (segment.name, &bootstrap) {
                (CHAIN | AGG_A, Some(bootstrap)) => RewardDone::chained(&terminal, bootstrap),
                _ => RewardDone { reward: segment.of(&all.reward), terminal },
            }
        };
        let (rewards, terminals): (Vec<Tensor>, Vec<Tensor>) =
            segments.iter().map(reward).map(|of| (of.reward, of.terminal)).unzip();
        let (reward, terminal) = (Tensor::cat(&rewards, 0), Tensor::cat(&terminals, 0));
        let q_target = iql::q_target(&reward, &terminal, &next_value, self.iql.discount);
        let weights = iql::advantage_weights(&target_q, &values.baseline, self.iql.temperature, self.iql.weight_cap);
        let weights = match (&bootstrap, chaining) {
            (Some(bootstrap), Some(chaining)) if chaining.weigh_by_value => {
                // The segments after the first are of the same pairs, in the same order.
                let ones = weights.narrow(0, 0, segments[0].len()).ones_like();
                let factors: Vec<&Tensor> =
                    std::iter::once(&ones).chain(segments[1..].iter().map(|_| bootstrap)).collect();
                weights * Tensor::cat(&factors, 0)
            }
            _ => weights,
        };
        let executed = all.executed.shallow_clone();
        CriticBatch { values, target_q, q_target, weights, executed, expectile: self.iql.expectile }
    }
}

/// The critic's values of all items of a batch.
pub(super) struct CriticBatch {
    values: CriticValues,
    /// min Q̄(s, a, z).
    target_q: Tensor,
    /// r + (1 − d) γ V(s′, z).
    q_target: Tensor,
    /// exp(β (Q̄ − V)), capped: the weights of the policy's loss.
    pub(crate) weights: Tensor,
    executed: Tensor,
    expectile: f64,
}

impl CriticBatch {
    /// Expectile regression of V towards Q̄.
    pub(crate) fn v_loss(&self, segments: &[Segment], terms: &mut LossTerms) -> Tensor {
        let loss = iql::value_loss(&self.values.value, &self.target_q, self.expectile);
        self.averaged("value_loss", &loss, segments, terms)
    }

    /// Squared error of both Q to r + (1 − d) γ V(s′).
    pub(crate) fn q_loss(&self, segments: &[Segment], terms: &mut LossTerms) -> Tensor {
        let [one, other] = [0, 1].map(|k| iql::q_loss(&self.values.q[k], &self.q_target));
        self.averaged("q_loss", &(one + other), segments, terms)
    }

    /// A loss over items, averaged segment by segment over what was executed, and weighed. A correction led nowhere, so that the
    /// policy alone learns from it.
    fn averaged(&self, name: &str, loss: &Tensor, segments: &[Segment], terms: &mut LossTerms) -> Tensor {
        let segment_loss = |segment: &Segment| {
            let executed = segment.of(&self.executed);
            let count = executed.sum(Kind::Float).clamp_min(1.0);
            let mean = (segment.of(loss) * &executed).sum(Kind::Float) / &count;
            terms.add(segment.label(name), &mean);
            mean * segment.weight
        };
        segments.iter().map(segment_loss).sum()
    }

    /// Weights and values, by the names of their segments.
    pub(crate) fn describe(&self, segments: &[Segment], numbers: &mut BTreeMap<String, f64>) {
        let value = &self.values.baseline;
        for segment in segments {
            let found = [
                ("weight_mean", segment.of(&self.weights).mean(Kind::Double)),
                ("weight_max", segment.of(&self.weights).max().to_kind(Kind::Double)),
                ("q_mean", segment.of(&self.target_q).mean(Kind::Double)),
                ("v_mean", segment.of(value).mean(Kind::Double)),
            ];
            numbers.extend(found.map(|(name, tensor)| (segment.label(name), tensor.double_value(&[]))));
        }
    }
}
