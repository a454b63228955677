//! What a policy server answered, as a decision.

use rmpv::Value;

use super::array::{Numbers, field};
use super::observation::named_classes;
use crate::agent::Values;
use crate::agent::decision::{ActionDistribution, Decision};
use crate::domain::{Action, ActionType, Class};
use crate::house::view::{Candidate, nearest};

/// The decision that an answer holds.
///
/// # Errors
/// Says which field is wrong and what it may be.
pub(super) fn decision(answer: &Value, candidates: &[Candidate]) -> Result<Decision, String> {
    let weights = weights(answer, candidates)?;
    let likeliest = weights.as_ref().map(likeliest);
    let kind = match (said_action(answer)?, likeliest) {
        (Some(kind), _) | (None, Some(kind)) => kind,
        (None, None) => {
            return Err(format!("it names no action: {ANSWERS}; what it says has {}", keys(answer)));
        }
    };
    let objects = object_weights(answer)?;
    let class = said_class(answer)?;
    let action = complete(kind, class, &objects, candidates);
    let greedy = match likeliest {
        Some(likeliest) if likeliest != kind => complete(likeliest, None, &objects, candidates),
        _ => action,
    };
    let distribution = weights.map(|weights| distribution(weights, objects, greedy, candidates));
    let values = scalar(answer, "value")?.map(|state| Values { state, choices: Vec::new() });
    let done = scalar(answer, "done")?;
    if done.is_some_and(|done| !(0.0..=1.0).contains(&done)) {
        return Err("done: it is a probability, from 0 to 1".into());
    }
    Ok(Decision { distribution, values, done, ..Decision::of(action) })
}

/// What is understood as an action.
const ANSWERS: &str = "answer with action (a name or its place in `actions`), with probabilities or logits, or with actions (an \
                       array of one number, the place)";

fn keys(answer: &Value) -> String {
    let keys = answer.as_map().into_iter().flatten().filter_map(|(key, _)| key.as_str());
    let keys: Vec<&str> = keys.take(10).collect();
    if keys.is_empty() { "no fields".into() } else { keys.join(", ") }
}

/// The action that is named, if one is.
fn said_action(answer: &Value) -> Result<Option<ActionType>, String> {
    let names = || ActionType::ALL.map(ActionType::name).join(", ");
    if let Some(name) = field(answer, "action").and_then(|action| action.as_str()) {
        let named = ActionType::ALL.into_iter().find(|kind| kind.name() == name);
        return named.map(Some).ok_or_else(|| format!("action: {name:?} is none of {}", names()));
    }
    let Some((which, value)) = ["action", "actions"].into_iter().find_map(|key| Some((key, field(answer, key)?)))
    else {
        return Ok(None);
    };
    let numbers = Numbers::read(value).map_err(|problem| format!("{which}: {problem}"))?;
    // Of a chunk of actions the first is taken: each step asks anew.
    let width = if numbers.shape.len() > 1 { numbers.shape[1..].iter().product() } else { numbers.values.len() };
    let place = match numbers.values.first() {
        Some(&place) if width == 1 => place,
        _ => return Err(format!("{which}: {width} numbers are no action here; {ANSWERS}")),
    };
    let index = (place.fract() == 0.0 && place >= 0.0).then_some(place as usize);
    let named = index.and_then(ActionType::from_index);
    named
        .map(Some)
        .ok_or_else(|| format!("{which}: {place} is no place from 0 to {} ({})", ActionType::COUNT - 1, names()))
}

/// The class that is named, if one is.
fn said_class(answer: &Value) -> Result<Option<Class>, String> {
    let Some((which, said)) = ["argument", "object"].into_iter().find_map(|key| Some((key, field(answer, key)?)))
    else {
        return Ok(None);
    };
    let name = said.as_str().ok_or_else(|| format!("{which}: it is no text"))?;
    Class::named(name).map(Some).ok_or_else(|| format!("{which}: there is no object class {name:?}"))
}

/// A finite number.
fn scalar(answer: &Value, which: &str) -> Result<Option<f32>, String> {
    let Some(value) = field(answer, which) else { return Ok(None) };
    let numbers = Numbers::read(value).map_err(|problem| format!("{which}: {problem}"))?;
    match numbers.values[..] {
        [number] if number.is_finite() => Ok(Some(number as f32)),
        [number] => Err(format!("{which}: {number} is no finite number")),
        _ => Err(format!("{which}: it is one number, not {}", numbers.values.len())),
    }
}

/// The weight of each action, where they are told; an action that is impossible now has none.
fn weights(answer: &Value, candidates: &[Candidate]) -> Result<Option<[Option<f32>; ActionType::COUNT]>, String> {
    let Some((which, told)) = ["probabilities", "logits"].into_iter().find_map(|key| Some((key, field(answer, key)?)))
    else {
        return Ok(None);
    };
    let numbers: Vec<Option<f64>> = match told.as_map().filter(|_| field(told, "data").is_none()) {
        Some(pairs) => {
            let known = |key: &Value| ActionType::ALL.into_iter().any(|kind| key.as_str() == Some(kind.name()));
            if let Some((key, _)) = pairs.iter().find(|(key, _)| !known(key)) {
                return Err(format!("{which}: {key} is no action"));
            }
            ActionType::ALL.map(|kind| field(told, kind.name()).map(|value| value.as_f64().unwrap_or(f64::NAN))).into()
        }
        None => {
            let numbers = Numbers::read(told).map_err(|problem| format!("{which}: {problem}"))?;
            numbers.values.into_iter().map(Some).collect()
        }
    };
    let numbers: [Option<f64>; ActionType::COUNT] = numbers.try_into().map_err(|numbers: Vec<_>| {
        format!("{which}: {} numbers, but there are {} actions", numbers.len(), ActionType::COUNT)
    })?;
    let is_logits = which == "logits";
    for (kind, number) in ActionType::ALL.into_iter().zip(numbers) {
        if number.is_some_and(|number| number.is_nan() || number == f64::INFINITY || (number < 0.0 && !is_logits)) {
            let number = number.unwrap_or_default();
            return Err(format!(
                "{which}: {number} of {} is no {}",
                kind.name(),
                if is_logits { "logit" } else { "probability" }
            ));
        }
    }
    let possible = |kind: ActionType| !kind.is_interaction() || candidates.iter().any(|it| it.kind == kind);
    let open = |at: usize| numbers[at].filter(|_| possible(ActionType::ALL[at]));
    let highest = (0..ActionType::COUNT).filter_map(open).fold(f64::NEG_INFINITY, f64::max);
    let weight = |number: f64| if is_logits { (number - highest).exp() } else { number };
    let weights: [Option<f64>; ActionType::COUNT] = std::array::from_fn(|at| open(at).map(weight));
    let sum: f64 = weights.iter().flatten().sum();
    match sum.is_finite() && sum > 0.0 {
        true => Ok(Some(weights.map(|weight| weight.map(|weight| (weight / sum) as f32)))),
        false => Err(format!("{which}: nothing that is possible now has any weight")),
    }
}

/// The likeliest action; the first of equal ones.
fn likeliest(weights: &[Option<f32>; ActionType::COUNT]) -> ActionType {
    let weight = |kind: ActionType| weights[kind.index()].unwrap_or(-1.0);
    ActionType::ALL
        .into_iter()
        .fold(ActionType::ALL[0], |best, kind| if weight(kind) > weight(best) { kind } else { best })
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
