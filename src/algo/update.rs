//! One update, in the order of implicit Q-learning: V, the actor, Q, the target. All losses are taken before any weight
//! changes, so that one that is not finite changes none.

use std::collections::BTreeMap;
use std::path::Path;

use tch::{Tensor, nn};

use super::batch::{Batch, Segment, Transitions};
use super::bc;
use super::chain::Chaining;
use super::critic::{CriticBatch, CriticLearner};
use super::learner::{Learner, Optimisation};
use super::loss_terms::{LossTerms, NotFinite};
use super::policy_extraction::{self, ForwardPass};
use crate::nets::policy::{Logits, PolicyNet};
use crate::nets::precision::Precision;
use crate::nets::weights::{self, Tensors};

/// A policy, and for IQL its critic, under training.
pub struct Update<'a> {
    policy: &'a PolicyNet,
    actor: Learner<'a>,
    critic: Option<CriticLearner<'a>>,
    chaining: Option<Chaining>,
    precision: Precision,
}

impl<'a> Update<'a> {
    /// Behaviour cloning, or with a critic IQL, or with `chaining` as well SPRINT.
    pub(crate) fn new(
        (policy, store): (&'a PolicyNet, &'a nn::VarStore),
        critic: Option<CriticLearner<'a>>,
        chaining: Option<Chaining>,
        optimisation: Optimisation,
        seed: u64,
    ) -> Update<'a> {
        let actor = Learner::new(store, optimisation, seed);
        Update { policy, actor, critic, chaining, precision: Precision::Full }
    }

    /// The same, but its networks compute with `precision`.
    pub(crate) fn with_precision(self, precision: Precision) -> Update<'a> {
        Update { precision, ..self }
    }

    /// Steps taken.
    pub(crate) fn step(&self) -> u64 {
        self.actor.step()
    }

    /// Whether all steps are taken.
    pub(crate) fn is_done(&self) -> bool {
        self.actor.is_done()
    }

    /// Takes one step. Returns the losses by name; with `report` also weights, values and accuracies.
    ///
    /// # Errors
    /// [`NotFinite`].
    pub fn update(&mut self, batch: &Batch, report: bool) -> Result<BTreeMap<String, f64>, NotFinite> {
        self.update_in_parts(std::slice::from_ref(batch), report)
    }

    /// The same of a batch in parts, which are computed one after the other and take less memory. Batch norms see a part at a time.
    ///
    /// # Errors
    /// [`NotFinite`].
    pub fn update_in_parts(&mut self, parts: &[Batch], report: bool) -> Result<BTreeMap<String, f64>, NotFinite> {
        self.actor.begin_step();
        let items: i64 = parts.iter().map(Batch::items).sum();
        let (mut actor, mut critic) = (GradientSum::default(), GradientSum::default());
        let mut numbers = BTreeMap::new();
        for part in parts {
            let share = part.items() as f64 / items.max(1) as f64;
            let losses = self.losses(part, report)?;
            actor.add(self.actor.gradients(&(losses.actor * share)));
            if let (Some(learner), Some(loss)) = (&self.critic, losses.critic) {
                critic.add(learner.gradients(&(loss * share)));
            }
            average(&mut numbers, losses.numbers, share);
        }
        self.actor.step_against(actor.0);
        if let Some(learner) = &mut self.critic {
            learner.update_v_and_q(critic.0);
            learner.update_target();
        }
        Ok(numbers)
    }

    /// The losses of a batch or of a part of it; no weight is changed.
    fn losses(&self, batch: &Batch, report: bool) -> Result<Losses, NotFinite> {
        let (all, segments) = batch.relabelled(self.chaining.as_ref(), self.precision);
        let critic = self.critic.as_ref().map(|critic| critic.evaluate(&all, &segments, self.chaining.as_ref()));
        let mut terms = LossTerms::default();
        let v_loss = critic.as_ref().map(|critic| critic.v_loss(&segments, &mut terms));
        let (actor, logits) = self.actor_loss(&all, &segments, critic.as_ref(), &mut terms);
        let q_loss = critic.as_ref().map(|critic| critic.q_loss(&segments, &mut terms));
        let mut numbers = terms.numbers(self.step() + 1)?;
        if report {
            numbers.extend(accuracies(&logits, &batch.base));
            if let Some(critic) = &critic {
                critic.describe(&segments, &mut numbers);
            }
        }
        Ok(Losses { actor, critic: v_loss.zip(q_loss).map(|(v, q)| v + q), numbers })
    }

    /// The loss of the policy, and its logits of the first forward pass, which begins with the demonstrated items. A chained
    /// item is no demonstration of its instruction: without the critic's weights there is nothing to clone in it.
    fn actor_loss(
        &self,
        all: &Transitions,
        segments: &[Segment],
        critic: Option<&CriticBatch>,
        terms: &mut LossTerms,
    ) -> (Tensor, Option<Logits>) {
        let (passes, weights) = match &self.critic {
            Some(critic) if critic.is_warming_up() => (ForwardPass::all(segments, None), None),
            _ => (ForwardPass::all(segments, self.chaining.as_ref()), critic.map(|critic| &critic.weights)),
        };
        let mut loss = Tensor::from(0.0f32).to_device(all.actions.device());
        let mut first = None;
        for pass in &passes {
            let (observations, conditioning) = (pass.observations(all), pass.conditionings(all));
            let logits = self.policy.forward_shared(&observations, &conditioning, pass.train);
            loss += policy_extraction::loss(&logits, all, pass, weights, terms);
            first.get_or_insert(logits);
        }
        (loss, first)
    }

    /// Every tensor of the training's state, by name.
    pub(crate) fn state(&self) -> Tensors {
        let mut tensors = weights::prefixed("policy.", self.actor.state());
        tensors.extend(self.critic.iter().flat_map(CriticLearner::state));
        tensors
    }

    /// Continues from a state that was saved after `step` steps.
    ///
    /// # Errors
    /// When a tensor is missing, unknown, or of another form; each is named with `path`, and nothing is changed.
    pub(crate) fn restore(&mut self, path: &Path, step: u64, tensors: &Tensors) -> anyhow::Result<()> {
        let own = self.state();
        weights::check(
            path,
            tensors,
            &own.iter().map(|(name, t)| (name.clone(), weights::TensorSpec::of(t))).collect(),
        )?;
        self.actor.restore(step, &weights::under("policy.", tensors))?;
        match &mut self.critic {
            Some(critic) => critic.restore(step, tensors),
            None => Ok(()),
        }
    }
}

/// What a batch, or a part of it, costs.
struct Losses {
    actor: Tensor,
    critic: Option<Tensor>,
    numbers: BTreeMap<String, f64>,
}

/// Gradients of the parts of a batch, added up.
#[derive(Default)]
struct GradientSum(Vec<Tensor>);

impl GradientSum {
    fn add(&mut self, gradients: Vec<Tensor>) {
        if self.0.is_empty() {
            self.0 = gradients;
            return;
        }
        for (sum, gradient) in self.0.iter_mut().zip(gradients).filter(|(_, gradient)| gradient.defined()) {
            *sum = if sum.defined() { &*sum + gradient } else { gradient };
        }
    }
}

/// Adds a part's numbers by its share; of what is largest the largest counts.
fn average(numbers: &mut BTreeMap<String, f64>, part: BTreeMap<String, f64>, share: f64) {
    for (name, value) in part {
        let largest = name.ends_with("max");
        let entry = numbers.entry(name).or_insert(if largest { f64::MIN } else { 0.0 });
        *entry = if largest { entry.max(value) } else { *entry + share * value };
    }
}

/// Shares of right answers among the demonstrated items, with which `logits` begin.
fn accuracies(logits: &Option<Logits>, base: &Transitions) -> Vec<(String, f64)> {
    let Some(logits) = logits else { return Vec::new() };
    let of_base = |all: &Tensor| all.narrow(0, 0, base.actions.size()[0]);
    let logits = Logits { actions: of_base(&logits.actions), objects: of_base(&logits.objects) };
    let (actions, objects) = bc::accuracy(&logits, &base.actions, &base.objects);
    vec![("action_accuracy".into(), actions), ("object_accuracy".into(), objects)]
}

#[cfg(test)]
mod tests;
