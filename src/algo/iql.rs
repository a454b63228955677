//! Implicit Q-learning (Kostrikov et al., 2022), conditioned on an instruction z: an equation a function. All are over items
//! `[n]`; how items are averaged is the caller's.

use serde::{Deserialize, Serialize};
use tch::{Kind, Tensor, nn};

/// The hyper-parameters of IQL.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Iql {
    pub(crate) discount: f64,
    /// τ: which expectile of Q over the demonstrated actions V is.
    pub(crate) expectile: f64,
    /// β: how many times the advantage enters the exponent of the policy's weights.
    pub(crate) temperature: f64,
    /// No weight is above this.
    pub(crate) weight_cap: f64,
    /// The share by which the target Q follows Q after each step.
    pub(crate) target_update_rate: f64,
    /// The share of the steps in which the policy only clones the demonstrated skills: a critic that knows nothing yet weighs
    /// at random. The paper has no such phase, and 140,000 steps.
    #[serde(default)]
    pub cloning_fraction: f64,
    /// How many times the advantage enters the exponent by which the agent weighs its policy when it decides. The paper's
    /// agent decides by its policy alone: 0.
    #[serde(default)]
    pub(crate) advantage_scale: f64,
}

impl Iql {
    /// Whether the equations hold with these numbers.
    ///
    /// # Errors
    /// Names the field of `iql` that is out of its bounds.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        let Iql { discount, expectile, temperature, weight_cap, target_update_rate, cloning_fraction, advantage_scale } =
            *self;
        for (field, share) in
            [("discount", discount), ("target_update_rate", target_update_rate), ("cloning_fraction", cloning_fraction)]
        {
            anyhow::ensure!((0.0..=1.0).contains(&share), "iql.{field} is {share}, which is not a share");
        }
        anyhow::ensure!(0.0 < expectile && expectile < 1.0, "iql.expectile is {expectile}, not between 0 and 1");
        for (field, weight) in
            [("temperature", temperature), ("weight_cap", weight_cap), ("advantage_scale", advantage_scale)]
        {
            anyhow::ensure!(weight.is_finite() && weight >= 0.0, "iql.{field} is {weight}, which is no weight");
        }
        Ok(())
    }
}

/// (V − Q̄)² times τ where V is below Q̄, else times 1 − τ. No gradient reaches `q`.
pub(crate) fn value_loss(value: &Tensor, q: &Tensor, expectile: f64) -> Tensor {
    let above = value - q.detach();
    let weight = above.lt(0.0).to_kind(Kind::Float) * (2.0 * expectile - 1.0) + (1.0 - expectile);
    weight * above.square()
}

/// r + (1 − d) γ V(s′, z), without gradient.
pub(crate) fn q_target(reward: &Tensor, terminal: &Tensor, next_value: &Tensor, discount: f64) -> Tensor {
    let goes_on = terminal.neg() + 1.0;
    (reward + goes_on * next_value * discount).detach()
}

/// (Q − target)². No gradient reaches `target`.
pub(crate) fn q_loss(q: &Tensor, target: &Tensor) -> Tensor {
    (q - target.detach()).square()
}

/// min(exp(β (Q̄ − V)), cap), without gradient.
pub(crate) fn advantage_weights(q: &Tensor, value: &Tensor, temperature: f64, cap: f64) -> Tensor {
    ((q - value) * temperature).exp().clamp_max(cap).detach()
}

/// A target network that follows another one: Polyak averaging.
pub(crate) struct PolyakTarget {
    pairs: Vec<(Tensor, Tensor)>,
}

impl PolyakTarget {
    /// Follows `online` with `target`, two stores of one network. Weights are averaged; statistics of batch norms, which are
    /// averages already, are copied.
    pub(crate) fn new(online: &nn::VarStore, target: &nn::VarStore) -> PolyakTarget {
        let mut targets = target.variables();
        let pair = |(name, tensor): (String, Tensor)| Some((tensor, targets.remove(&name)?));
        PolyakTarget { pairs: online.variables().into_iter().filter_map(pair).collect() }
    }

    /// Moves the target by `rate` of what separates it from the followed network.
    pub(crate) fn update(&mut self, rate: f64) {
        tch::no_grad(|| {
            for (online, target) in &mut self.pairs {
                if online.requires_grad() {
                    let _ = target.lerp_(online, rate);
                } else {
                    target.copy_(online);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use tch::Device;

    use super::*;

    fn tensor(values: &[f32]) -> Tensor {
        Tensor::from_slice(values)
    }

    fn close(found: &Tensor, expected: &[f64]) {
        let found = Vec::<f64>::try_from(found.to_kind(Kind::Double)).unwrap();
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} is not {expected:?}");
    }

    #[test]
    fn the_expectile_loss_by_hand() {
        // 0.5 below: 0.9 x 0.25. 0.5 above: 0.1 x 0.25. Equal: 0.
        close(&value_loss(&tensor(&[0.0, 1.0, 0.5]), &tensor(&[0.5, 0.5, 0.5]), 0.9), &[0.225, 0.025, 0.0]);
    }

    #[test]
    fn the_bootstrap_stops_at_the_end_by_hand() {
        let target = q_target(&tensor(&[0.0, 1.0]), &tensor(&[0.0, 1.0]), &tensor(&[0.5, 0.5]), 0.98);
        close(&target, &[0.49, 1.0]);
        close(&q_loss(&tensor(&[0.5, 0.5]), &target), &[0.0001, 0.25]);
    }

    #[test]
    fn weights_grow_with_the_advantage_up_to_the_cap_by_hand() {
        let weights = advantage_weights(&tensor(&[0.5, 0.6, 0.4, 1.0]), &tensor(&[0.5, 0.5, 0.5, 0.5]), 10.0, 100.0);
        let e = std::f64::consts::E;
        close(&weights, &[1.0, e, 1.0 / e, 100.0]);
    }

    #[test]
    fn gradients_are_the_finite_differences_and_reach_only_what_is_learned() {
        let (q, target) = (tensor(&[0.3, 0.8]).set_requires_grad(true), tensor(&[0.6, 0.1]).set_requires_grad(true));
        let slope = |loss: &dyn Fn(&Tensor) -> Tensor, at: &Tensor| {
            let step = 1e-3;
            (loss(&(at + step)) - loss(&(at - step))) / (2.0 * step)
        };
        let losses: [&dyn Fn(&Tensor) -> Tensor; 2] =
            [&|value| value_loss(value, &target, 0.9), &|value| q_loss(value, &target)];
        for loss in losses {
            let mut q = q.detach().set_requires_grad(true);
            loss(&q).sum(Kind::Float).backward();
            let expected = Vec::<f64>::try_from(slope(loss, &q.detach()).to_kind(Kind::Double)).unwrap();
            let found = Vec::<f64>::try_from(q.grad().to_kind(Kind::Double)).unwrap();
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?} {expected:?}");
            q.zero_grad();
        }
        assert!(!target.grad().defined());
        assert!(!q_target(&q, &q, &q, 0.9).requires_grad());
        assert!(!advantage_weights(&q, &q, 1.0, 1.0).requires_grad());
    }

    #[test]
    fn the_minimum_of_the_expectile_loss_is_the_expectile() {
        // Of 0 and 1 in equal shares the 0.9-expectile is 0.9: 0.9 (1 − v) = 0.1 v.
        let q = tensor(&[0.0, 1.0]);
        let loss = |v: f64| value_loss(&tensor(&[v as f32; 2]), &q, 0.9).sum(Kind::Float).double_value(&[]);
        assert!(loss(0.9) < loss(0.88) && loss(0.9) < loss(0.92));
    }

    /// Two states: action 0 leads from state 0 to state 1 and from there to the end, action 1 back to state 0. Each is as frequent.
    /// All is learned by tables, with every equation of this file, from zero.
    #[test]
    fn a_chain_of_two_states_is_learned_to_a_hundredth() {
        let _chance = crate::nets::testing::chance();
        const DISCOUNT: f64 = 0.9;
        const EXPECTILE: f64 = 0.9;
        const TEMPERATURE: f64 = 3.0;
        let store = nn::VarStore::new(Device::Cpu);
        let [q, logits] = ["q", "logits"].map(|name| store.root().zeros(name, &[4]));
        let value = store.root().zeros("value", &[2]);
        let [state, next, other] = [[0i64, 0, 1, 1], [1, 0, 0, 0], [1, 0, 3, 2]].map(|rows| Tensor::from_slice(&rows));
        let terminal = tensor(&[0.0, 0.0, 1.0, 0.0]);
        let mut optimiser = nn::OptimizerConfig::build(nn::Sgd::default(), &store, 0.5).unwrap();
        for _ in 0..600 {
            let here = value.index_select(0, &state);
            let target = q_target(&terminal, &terminal, &value.index_select(0, &next), DISCOUNT);
            let weights = advantage_weights(&q, &here, TEMPERATURE, 100.0);
            // Of two actions, the logarithm of one's share.
            let share = (&logits - logits.index_select(0, &other)).log_sigmoid();
            let loss = q_loss(&q, &target) + value_loss(&here, &q, EXPECTILE) - weights * share * 0.5;
            optimiser.backward_step(&loss.sum(Kind::Float));
        }
        // The right answers: of two numbers a > b the expectile is τ a + (1 − τ) b.
        let (mut v, mut right) = ([0.0f64; 2], [0.0f64; 4]);
        for _ in 0..1000 {
            right = [DISCOUNT * v[1], DISCOUNT * v[0], 1.0, DISCOUNT * v[0]];
            v = [0, 2].map(|i| {
                let (high, low) = (right[i].max(right[i + 1]), right[i].min(right[i + 1]));
                EXPECTILE * high + (1.0 - EXPECTILE) * low
            });
        }
        let weight = |i: usize| (TEMPERATURE * (right[i] - v[i / 2])).exp();
        let policy = [0, 1, 2, 3].map(|i: usize| weight(i) / (weight(i) + weight(i ^ 1)));
        let near = |found: Tensor, right: &[f64]| {
            let found = Vec::<f64>::try_from(found.detach().to_kind(Kind::Double)).unwrap();
            assert!(found.iter().zip(right).all(|(a, b)| (a - b).abs() < 1e-2), "{found:?} is not {right:?}");
        };
        near(q.shallow_clone(), &right);
        near(value.shallow_clone(), &v);
        near((&logits - logits.index_select(0, &other)).sigmoid(), &policy);
    }

    #[test]
    fn a_target_follows_by_its_rate_and_copies_statistics() {
        let [online, target] = [2.0, 1.0].map(|value| {
            let store = nn::VarStore::new(Device::Cpu);
            let _ = store.root().var("weight", &[1], nn::Init::Const(value));
            let _ = store.root().zeros_no_train("mean", &[1]) + value;
            let _ = tch::no_grad(|| store.variables()["mean"].shallow_clone().fill_(value));
            store
        });
        PolyakTarget::new(&online, &target).update(0.005);
        assert!((target.variables()["weight"].double_value(&[0]) - 1.005).abs() < 1e-6);
        assert_eq!(target.variables()["mean"].double_value(&[0]), 2.0);
    }
}
