//! Cross-trajectory chaining: the value of one skill's end for another skill (the paper's equations 4 and 5). Pairs (A, B) of
//! items; z_A and z_B are their instructions. No trajectory is joined: each part is trained on alone.

use serde::{Deserialize, Serialize};
use tch::Tensor;

/// How skills are chained. Where the paper leaves a choice open, the fields say what is taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chaining {
    /// Drawn from the batch, or from a pool.
    pub pairs: PairSource,
    /// Only pairs that a language model ranked high, under its own text: those of the datasets' chains.jsonl (the paper's LLM-chain).
    /// `pairs` does not count then.
    #[serde(default)]
    pub(crate) ranked: bool,
    /// The share of a pool's pairs that come from one floor plan, A ending with in the hand what B began with; of random pairs
    /// hardly any do.
    #[serde(default)]
    pub(crate) feasible_share: f64,
    /// Whether each chained item weighs as much as its pair's bootstrap: as likely as the critic thinks that B follows A.
    #[serde(default)]
    pub(crate) weigh_by_value: bool,
    /// Pairs in a step; the paper's is the batch.
    pub batch_size: usize,
    /// What A's reward at the cut is bootstrapped from.
    pub(crate) bootstrap: Bootstrap,
    /// What the policy learns from; the critic learns from both equations.
    pub(crate) policy_extraction: PolicyExtraction,
    /// Whose statistics normalise chained items while the policy learns from them.
    pub(crate) batch_norm_statistics: BatchNormStatistics,
    /// The weight of both equations together; that of the base loss is 1.
    pub(crate) loss_weight: f64,
    /// The weight of equation 4 within chaining.
    pub(crate) chain_weight: f64,
    /// The weight of equation 5 within chaining; 0 where there are no sentences to join.
    pub(crate) aggregate_weight: f64,
}

/// Which equations the policy learns from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PolicyExtraction {
    /// Both, as in the paper.
    Both,
    /// Equation 5 alone. Where neither of two skills serves the other, no action is better than another for equation 4, so that
    /// it weighs as much as a demonstration and clones A under B's instruction.
    Aggregate,
}

/// Whose statistics the policy's batch norms use for chained items.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum BatchNormStatistics {
    /// Those of the whole batch: what an agent sees later is normalised by a mixture that it never meets.
    WholeBatch,
    /// The running ones of demonstrated items, which alone keep them up. Of chained items no unit is dropped then.
    Demonstrations,
}

/// Where pairs of skills come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PairSource {
    /// The batch and a permutation of it; the joint sentences are embedded at every step.
    InBatch,
    /// So many pairs of texts, drawn once; their joint sentences are embedded once.
    Pool(usize),
}

/// How likely equation 4 ends A at a transition, `left` steps (itself included) before its span's end: the cut is a step drawn
/// uniformly between the drawn one and the span's last.
pub(crate) fn cut_chance(left: u32) -> f64 {
    1.0 / f64::from(left.max(1))
}

/// The estimate of what B can make of the state that A ends in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Bootstrap {
    /// V(s′, z_B): of the state after A's last action. The paper's implementation.
    NextValue,
    /// min Q̄(s, a, z_B) of the last action itself. The paper's equations, and Actionable Models.
    TargetQ,
}

/// A transition's reward and whether it ends the episode, both `[n]`.
#[derive(Debug)]
pub(crate) struct RewardDone {
    /// r, 0 to 1.
    pub(crate) reward: Tensor,
    /// d, 0 or 1.
    pub(crate) terminal: Tensor,
}

impl RewardDone {
    /// A demonstrated skill: reward 1 on the transition into the span's last state, which ends it. Also equation 5's B.
    pub(crate) fn of_skill(terminal: &Tensor) -> RewardDone {
        RewardDone { reward: terminal.shallow_clone(), terminal: terminal.shallow_clone() }
    }

    /// Equation 4: A under z_B, cut where `cut` is 1; the reward there is the `bootstrap`. Equation 5's A, under "A. B.": the
    /// cut is the span's own end.
    pub(crate) fn chained(cut: &Tensor, bootstrap: &Tensor) -> RewardDone {
        RewardDone { reward: cut * bootstrap, terminal: cut.shallow_clone() }
    }
}

/// A bootstrapped value as a reward: without gradient, and within 0..1, where every return lies.
pub(crate) fn as_reward(bootstrap: &Tensor) -> Tensor {
    bootstrap.detach().clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use tch::{Device, Kind, nn};

    use super::*;
    use crate::algo::iql;

    #[test]
    fn rewards_by_hand() {
        let (d, bootstrap) = (Tensor::from_slice(&[0.0f32, 1.0, 1.0]), Tensor::from_slice(&[0.7f32, 1.3, 0.4]));
        let base = RewardDone::of_skill(&d);
        assert_eq!(Vec::<f32>::try_from(base.reward).unwrap(), [0.0, 1.0, 1.0]);
        let chained = RewardDone::chained(&d, &as_reward(&bootstrap));
        assert_eq!(Vec::<f32>::try_from(chained.reward).unwrap(), [0.0, 1.0, 0.4]);
    }

    #[test]
    fn each_transition_left_is_as_likely_a_cut() {
        assert_eq!([1, 2, 4].map(cut_chance), [1.0, 0.5, 0.25]);
    }

    /// V by tables: two demonstrations, states 0 to 2 under A and 2 to 4 under B, and "A. B." from state 0. Rows are texts (A, B,
    /// "A. B."), columns states.
    fn values(chaining: bool) -> Vec<Vec<f64>> {
        const DISCOUNT: f64 = 0.9;
        let store = nn::VarStore::new(Device::Cpu);
        let value = store.root().zeros("value", &[3, 5]);
        let q = store.root().zeros("q", &[3, 5]);
        let row = |states: [i64; 2], text: i64| -> (Tensor, Tensor) {
            (Tensor::from_slice(&[text; 2]), Tensor::from_slice(&states))
        };
        let at = |table: &Tensor, (text, state): &(Tensor, Tensor), shift: i64| {
            table.index(&[Some(text), Some(&(state + shift))])
        };
        let ends = Tensor::from_slice(&[0.0f32, 1.0]);
        let (first, second) = ([0, 1], [2, 3]);
        let mut optimiser = nn::OptimizerConfig::build(nn::Sgd::default(), &store, 1.0).unwrap();
        for _ in 0..200 {
            let bootstrap = as_reward(&at(&value, &row(first, 1), 1));
            let mut parts =
                vec![(row(first, 0), RewardDone::of_skill(&ends)), (row(second, 1), RewardDone::of_skill(&ends))];
            if chaining {
                parts.push((row(first, 1), RewardDone::chained(&ends, &bootstrap)));
                parts.push((row(first, 2), RewardDone::chained(&ends, &bootstrap)));
                parts.push((row(second, 2), RewardDone::of_skill(&ends)));
            }
            let mut loss = Tensor::from(0.0f32);
            for (place, RewardDone { reward, terminal }) in &parts {
                let target = iql::q_target(reward, terminal, &at(&value, place, 1), DISCOUNT);
                loss += iql::q_loss(&at(&q, place, 0), &target).mean(Kind::Float);
                loss += iql::value_loss(&at(&value, place, 0), &at(&q, place, 0), 0.5).mean(Kind::Float);
            }
            optimiser.backward_step(&loss);
        }
        (0..3).map(|text| Vec::<f64>::try_from(value.get(text).to_kind(Kind::Double).detach()).unwrap()).collect()
    }

    #[test]
    fn only_chaining_stitches_two_trajectories() {
        // A step towards the end of either skill is worth 0.9 of what it leads to; the joint itself costs nothing.
        let with = values(true);
        let b_from_the_start = with[1][0];
        let both_from_the_start = with[2][0];
        assert!((b_from_the_start - 0.81).abs() < 0.01, "{with:?}");
        assert!((both_from_the_start - 0.81).abs() < 0.01, "{with:?}");
        assert!((with[2][2] - 0.9).abs() < 0.01, "half way it is B that is left: {with:?}");
        let without = values(false);
        assert!(without[1][0].abs() < 0.01 && without[2][0].abs() < 0.01, "{without:?}");
    }
}
