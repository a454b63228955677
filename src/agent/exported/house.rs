//! An exported policy in House: its logits as ALFRED's actions and object classes.

use anyhow::{Context, ensure};

use super::answer::Answer;
use super::spec::PolicySpec;
use crate::agent::decision::Decision;
use crate::agent::decision_rule::DecisionRule;
use crate::agent::select::{self, Heads, Selection};
use crate::domain::{ActionType, Class};
use crate::house::view::Candidate;

/// What an action or class weighs that the policy does not know or masks.
const NEVER: f32 = -1e9;

/// Checks that all names of a description are House's.
///
/// # Errors
/// Names the first that is not.
pub(super) fn check(spec: &PolicySpec) -> anyhow::Result<()> {
    for name in &spec.actions {
        let known = ActionType::ALL.map(ActionType::name);
        ensure!(known.contains(&name.as_str()), "its action {name:?} is none of House's: {}", known.join(", "));
    }
    let strange = spec.arguments.iter().find(|name| Class::named(name).is_none_or(|class| !class.in_vocabulary()));
    ensure!(
        strange.is_none(),
        "its argument {:?} is none of House's object classes",
        strange.map_or("", String::as_str)
    );
    Ok(())
}

/// The decision: of the possible actions the likeliest, then its likeliest class; or both by chance.
///
/// # Errors
/// When nothing that it knows is possible.
pub(super) fn decide(
    answer: &Answer,
    spec: &PolicySpec,
    candidates: &[Candidate],
    selection: Selection<'_>,
) -> anyhow::Result<Decision> {
    let logit = |kind: ActionType| {
        let place = spec.actions.iter().position(|name| name == kind.name());
        place.map(|place| answer.actions[place]).filter(|logit| logit.is_finite())
    };
    let never: Vec<ActionType> = ActionType::ALL.into_iter().filter(|&kind| logit(kind).is_none()).collect();
    let open: Vec<Candidate> = candidates.iter().filter(|it| !never.contains(&it.kind)).copied().collect();
    let moves = ActionType::ALL.iter().any(|kind| !kind.is_interaction() && !never.contains(kind));
    ensure!(moves || !open.is_empty(), "nothing that it would do is possible here");
    let actions = ActionType::ALL.map(|kind| logit(kind).unwrap_or(NEVER));
    let mut classes = vec![if spec.arguments.is_empty() { 0.0 } else { NEVER }; Class::VOCABULARY];
    for (name, &logit) in spec.arguments.iter().zip(&answer.arguments) {
        let class = Class::named(name).with_context(|| format!("there is no object class {name:?}"))?;
        if let Some(entry) = classes.get_mut(class.index()) {
            *entry = logit.max(NEVER);
        }
    }
    let heads = Heads { actions: &actions, objects: &classes, advantage_scale: None, rule: DecisionRule::Paper };
    Ok(select::decide(&heads, &open, &never, selection))
}
