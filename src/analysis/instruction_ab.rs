//! Two instructions in one state: does the policy listen?

use crate::agent::{Decision, Policy, Values};
use crate::domain::{ActionType, Class};
use crate::env::Environment;
use crate::episode::rollout::Rollout;
use crate::house::view::Candidate;
use crate::language::instruction;

/// One instruction in a state.
#[derive(Clone, Debug)]
pub(crate) struct Side {
    pub(crate) instruction: String,
    /// What the policy would do.
    pub(crate) decision: Decision,
    /// What its critics say.
    pub(crate) values: Option<Values>,
}

/// What two instructions come to in one state.
#[derive(Clone, Debug)]
pub struct Contrast {
    /// The one in force and the other.
    pub(crate) sides: [Side; 2],
    /// Every choice with its probability under each.
    pub(crate) rows: Vec<Row>,
    /// The Jensen-Shannon divergence of both distributions over choices, in bits: 0 is the same, 1 is nothing in common.
    pub(crate) divergence: f32,
    /// The mean divergence between the one in force and [`REFERENCES`]: how much language matters here at all.
    pub(crate) sensitivity: f32,
}

/// A choice under both instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) kind: ActionType,
    pub(crate) class: Option<Class>,
    /// How likely it is under each.
    pub(crate) shares: [f32; 2],
}

/// The instructions against which sensitivity is measured: one for each kind of skill, and one that asks for nothing.
pub(crate) const REFERENCES: [&str; 8] = [
    "Pick up the mug.",
    "Put the apple in the fridge.",
    "Slice the tomato.",
    "Turn on the lamp.",
    "Wash the plate in the sink.",
    "Heat the potato in the microwave.",
    "Cool the bread in the fridge.",
    "Do nothing.",
];

/// Compares the instruction in force with another. The policy is left as it was.
///
/// # Errors
/// When the other text is no instruction, or the policy cannot go on or has no distribution.
pub(crate) fn contrast<E: Environment>(
    policy: &mut dyn Policy,
    rollout: &mut Rollout<E>,
    other: &str,
) -> anyhow::Result<Contrast> {
    let other = instruction::parse(other)?;
    let own = rollout.instruction.clone();
    let candidates = rollout.env.legal_actions()?;
    let state = policy.state(0);
    let mut ask = |text: &str| -> anyhow::Result<Side> {
        policy.restore(0, state.clone());
        rollout.instruction = text.to_string();
        let decided = rollout.decide(policy);
        let values = decided.as_ref().map_or(Ok(None), |decision| rollout.values(policy, decision));
        policy.restore(0, state.clone());
        Ok(Side { instruction: text.to_string(), decision: decided?, values: values? })
    };
    let asked = || -> anyhow::Result<Contrast> {
        let sides = [ask(&own)?, ask(&other)?];
        let of = |side: &Side| distribution(side, &candidates);
        let (one, two) = (of(&sides[0])?, of(&sides[1])?);
        let mut sum = 0.0;
        for text in REFERENCES {
            sum += divergence(&one, &of(&ask(text)?)?);
        }
        let mut rows: Vec<Row> = one
            .iter()
            .zip(&two)
            .map(|(&(kind, class, first), &(_, _, second))| Row { kind, class, shares: [first, second] })
            .collect();
        rows.sort_by(|a, b| (b.shares[0] - b.shares[1]).abs().total_cmp(&(a.shares[0] - a.shares[1]).abs()));
        let (divergence, sensitivity) = (divergence(&one, &two), sum / REFERENCES.len() as f32);
        Ok(Contrast { sides, rows, divergence, sensitivity })
    };
    let found = { asked }();
    rollout.instruction = own;
    found
}

type Share = (ActionType, Option<Class>, f32);

fn distribution(side: &Side, candidates: &[Candidate]) -> anyhow::Result<Vec<Share>> {
    let mind = side.decision.distribution.as_ref();
    Ok(mind.ok_or_else(|| anyhow::anyhow!("this policy has no distribution to compare"))?.joint(candidates))
}

/// The Jensen-Shannon divergence of two distributions over the same choices, in bits.
fn divergence(one: &[Share], two: &[Share]) -> f32 {
    let part = |p: f32, q: f32| if p > 0.0 { p * (p / ((p + q) / 2.0)).log2() } else { 0.0 };
    let sum: f32 = one.iter().zip(two).map(|(a, b)| part(a.2, b.2) + part(b.2, a.2)).sum();
    (sum / 2.0).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::policy::each_alone;
    use crate::agent::{ActionDistribution, Decisions, Observation};
    use crate::domain::Action;
    use crate::house::testing::kitchen_house;

    /// Turns left when told to, else right.
    struct Listener;

    impl Policy for Listener {
        fn name(&self) -> &str {
            "listener"
        }

        fn slots(&self) -> usize {
            1
        }

        fn reset(&mut self, _slot: usize, _seed: u64) {}

        fn act(&mut self, observations: &mut [Option<Observation<'_>>]) -> anyhow::Result<Decisions> {
            each_alone(observations, |_, here| {
                let left = here.instruction.contains("left");
                let mut actions = [None; ActionType::COUNT];
                let likely = if left { ActionType::RotateLeft } else { ActionType::RotateRight };
                actions[likely.index()] = Some(1.0);
                let action = Action::navigate(likely);
                let (objects, choices) = (vec![], vec![]);
                let distribution = ActionDistribution { actions, objects, choices, entropy: 0.0, greedy: action };
                Ok(Decision { action, distribution: Some(distribution), values: None, done: None, own: None })
            })
        }
    }

    #[test]
    fn a_policy_that_listens_differs_and_the_instruction_stays() {
        let mut rollout = Rollout::in_house(kitchen_house(), "Turn right.".into(), None, None);
        let found = contrast(&mut Listener, &mut rollout, "turn left").unwrap();
        assert!((found.divergence - 1.0).abs() < 1e-6 && found.sensitivity == 0.0, "{found:?}");
        assert_eq!(rollout.instruction, "Turn right.");
        assert_eq!(found.sides[1].instruction, "Turn left.");
        assert!((found.rows[0].shares[0] - found.rows[0].shares[1]).abs() > 0.99);
        let same = contrast(&mut Listener, &mut rollout, "stand still").unwrap();
        assert_eq!(same.divergence, 0.0);
        assert!(contrast(&mut Listener, &mut rollout, "").is_err());
    }
}
