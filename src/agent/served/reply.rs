//! What a policy server answered in House, as a decision.

use rmpv::Value;

use super::answer::{argument, chosen, likeliest, shares, value_and_end};
use super::array::field;
use super::observation::named_classes;
use crate::agent::decision::{ActionDistribution, Decision};
use crate::domain::{Action, ActionType, Class};
use crate::house::view::{Candidate, nearest};

/// The decision that an answer holds.
///
/// # Errors
/// Says which field is wrong and what it may be.
pub(super) fn decision(answer: &Value, candidates: &[Candidate]) -> Result<Decision, String> {
    let names = ActionType::ALL.map(ActionType::name);
    let possible = |kind: ActionType| !kind.is_interaction() || candidates.iter().any(|it| it.kind == kind);
    let shares = shares(answer, &names, |place| possible(ActionType::ALL[place]))?;
    let kind = ActionType::ALL[chosen(answer, &names, shares.as_ref())?];
    let objects = object_weights(answer)?;
    let action = complete(kind, said_class(answer)?, &objects, candidates);
    let greedy = match shares.as_ref().map(|shares| ActionType::ALL[likeliest(shares)]) {
        Some(likeliest) if likeliest != kind => complete(likeliest, None, &objects, candidates),
        _ => action,
    };
    let shares: Option<[Option<f32>; ActionType::COUNT]> = shares.and_then(|shares| shares.try_into().ok());
    let distribution = shares.map(|shares| distribution(shares, objects, greedy, candidates));
    let (values, done) = value_and_end(answer)?;
    Ok(Decision { distribution, values, done, ..Decision::of(action) })
}

/// The class that is named, if one is.
fn said_class(answer: &Value) -> Result<Option<Class>, String> {
    let Some((which, said)) = argument(answer) else { return Ok(None) };
    let name = said.as_str().ok_or_else(|| format!("{which}: it is no text"))?;
    Class::named(name).map(Some).ok_or_else(|| format!("{which}: there is no object class {name:?}"))
}

/// Object classes by falling weight, where they are told.
fn object_weights(answer: &Value) -> Result<Vec<(Class, f32)>, String> {
    let Some((which, told)) =
        ["argument_probabilities", "object_probabilities"].into_iter().find_map(|key| Some((key, field(answer, key)?)))
    else {
        return Ok(Vec::new());
    };
    let pairs = told.as_map().ok_or_else(|| format!("{which}: it is a map of classes to probabilities"))?;
    let mut weights = Vec::with_capacity(pairs.len());
    for (key, value) in pairs {
        let class = key.as_str().and_then(Class::named).ok_or_else(|| format!("{which}: there is no class {key}"))?;
        let weight = value.as_f64().filter(|weight| weight.is_finite() && *weight >= 0.0);
        weights.push((
            class,
            weight.ok_or_else(|| format!("{which}: {value} of {} is no probability", class.name()))? as f32,
        ));
    }
    weights.sort_by(|a, b| b.1.total_cmp(&a.1));
    Ok(weights)
}

/// Adds what an interaction acts on: the nearest thing of the named class, else of the likeliest that could be named now, else
/// the nearest of all. An interaction with what is not at hand comes out as impossible.
fn complete(kind: ActionType, class: Option<Class>, objects: &[(Class, f32)], candidates: &[Candidate]) -> Action {
    if !kind.is_interaction() {
        return Action::navigate(kind);
    }
    let named = class.or_else(|| {
        let could = |class: &Class| nearest(candidates, kind, *class).is_some();
        let likeliest = objects.iter().map(|(class, _)| *class).find(could);
        likeliest.or_else(|| named_classes(candidates, kind).first().copied())
    });
    let target = named.and_then(|class| nearest(candidates, kind, class));
    target.map_or_else(|| Action::navigate(kind), Candidate::action)
}

fn distribution(
    actions: [Option<f32>; ActionType::COUNT],
    objects: Vec<(Class, f32)>,
    greedy: Action,
    candidates: &[Candidate],
) -> ActionDistribution {
    let entropy = -actions.iter().flatten().filter(|&&p| p > 0.0).map(|p| p * p.ln()).sum::<f32>();
    let weight = |class: Class| objects.iter().find(|(other, _)| *other == class).map(|(_, weight)| *weight);
    let interactions = ActionType::ALL.into_iter().filter(|kind| kind.is_interaction());
    let choices = interactions
        .flat_map(|kind| named_classes(candidates, kind).into_iter().map(move |class| (kind, class)))
        .filter_map(|(kind, class)| Some((kind, class, weight(class)?)))
        .collect();
    let at_hand = |class: Class| candidates.iter().any(|candidate| candidate.class == class);
    let objects = objects.iter().map(|&(class, weight)| (class, weight, at_hand(class))).collect();
    ActionDistribution { actions, objects, choices, entropy, greedy }
}
