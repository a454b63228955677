//! Everything that could be done now, as rows of a table: how likely, how good.

use super::exploration::SessionSnapshot;
use crate::agent::{ActionDistribution, Decision, Values};
use crate::domain::{Action, ActionType, Class};

/// A thing that could be done now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Choice {
    /// The action.
    pub(crate) kind: ActionType,
    /// The class whose nearest instance it is done to.
    pub(crate) class: Option<Class>,
    /// How likely the policy is to do it.
    pub(crate) probability: Option<f32>,
    /// The smaller of the critics' Q.
    pub(crate) q: Option<f32>,
    /// How much better than the state's value that is.
    pub(crate) advantage: Option<f32>,
    /// It is what the policy chose.
    pub(crate) chosen: bool,
    /// It is what the policy would take without chance.
    pub(crate) greedy: bool,
}

/// By what the table is sorted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sort {
    /// The likeliest first.
    Probability,
    /// The best first.
    Q,
    /// In the order of actions.
    Action,
}

impl Sort {
    /// The next way, around.
    pub(crate) fn next(self) -> Sort {
        match self {
            Sort::Probability => Sort::Q,
            Sort::Q => Sort::Action,
            Sort::Action => Sort::Probability,
        }
    }

    /// In a word.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Sort::Probability => "probability",
            Sort::Q => "Q",
            Sort::Action => "action",
        }
    }
}

/// Every legal action, interactions once for each class that is a candidate.
pub(crate) fn choices(now: &SessionSnapshot, decision: &Decision, values: Option<&Values>, sort: Sort) -> Vec<Choice> {
    let class_of = |action: Action| action.target.and_then(|target| now.world.class_of(&now.scene, target));
    let distribution = decision.distribution.as_ref();
    let joint = match distribution {
        Some(distribution) => distribution.joint(&now.candidates),
        None => legal(now),
    };
    let row = |(kind, class, p): (ActionType, Option<Class>, f32)| {
        let is = |action: Action| action.kind == kind && class_of(action) == class;
        Choice {
            kind,
            class,
            probability: distribution.map(|_| p),
            q: values.and_then(|values| values.q(kind, class)),
            advantage: values.and_then(|values| values.advantage(kind, class)),
            chosen: is(decision.action),
            greedy: distribution.is_some_and(|distribution| is(distribution.greedy)),
        }
    };
    let mut rows: Vec<Choice> = joint.into_iter().map(row).collect();
    let falling = |a: Option<f32>, b: Option<f32>| b.unwrap_or(f32::MIN).total_cmp(&a.unwrap_or(f32::MIN));
    match sort {
        Sort::Probability => rows.sort_by(|a, b| falling(a.probability, b.probability)),
        Sort::Q => rows.sort_by(|a, b| falling(a.q, b.q).then(falling(a.probability, b.probability))),
        Sort::Action => {}
    }
    rows
}

/// The choices of a policy without a distribution.
fn legal(now: &SessionSnapshot) -> Vec<(ActionType, Option<Class>, f32)> {
    let uniform = ActionDistribution {
        actions: [None; ActionType::COUNT],
        objects: Vec::new(),
        choices: Vec::new(),
        entropy: 0.0,
        greedy: Action::navigate(ActionType::MoveAhead),
    };
    uniform.joint(&now.candidates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::value_estimates::ChoiceValue;
    use crate::explore::session::SessionEvent;
    use crate::explore::testing;

    #[test]
    fn every_legal_choice_is_a_row_and_the_table_sorts() {
        let now = testing::snapshot(&mut testing::exploration());
        let SessionEvent::Decided(decision, ..) = testing::decided(&now) else { panic!() };
        let rows = choices(&now, &decision, None, Sort::Probability);
        assert_eq!(rows.len(), 5 + 3, "five to navigate, two pickups, one open");
        assert_eq!((rows[0].kind, rows[0].class.unwrap().name(), rows[0].chosen), (ActionType::Pickup, "Mug", true));
        let sum: f32 = rows.iter().filter_map(|row| row.probability).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        let values =
            Values { state: 0.5, choices: vec![ChoiceValue { kind: ActionType::LookUp, class: None, q: 0.7 }] };
        let rows = choices(&now, &decision, Some(&values), Sort::Q);
        assert_eq!(rows[0].kind, ActionType::LookUp);
        assert!((rows[0].advantage.unwrap() - 0.2).abs() < 1e-6);
    }
}
