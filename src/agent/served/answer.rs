//! What a policy server answered, whatever its actions are about: which action, how likely each is, values.

use rmpv::Value;

use super::array::{Numbers, field};
use crate::agent::Values;

/// What is understood as an action.
const ANSWERS: &str = "answer with action (a name or its place in `actions`), with probabilities or logits, or with actions (an \
                       array of one number, the place)";
/// Names that a refusal lists.
const LISTED: usize = 30;

/// How likely each action is; an action that is impossible now has no share.
pub(super) type Shares = Vec<Option<f32>>;

/// The place of the action that is to be done: the named one, else the likeliest.
///
/// # Errors
/// When none is named, or one that there is not.
pub(super) fn chosen(answer: &Value, names: &[&str], shares: Option<&Shares>) -> Result<usize, String> {
    match (named(answer, names)?, shares.map(likeliest)) {
        (Some(place), _) | (None, Some(place)) => Ok(place),
        (None, None) => Err(format!("it names no action: {ANSWERS}; what it says has {}", keys(answer))),
    }
}

fn keys(answer: &Value) -> String {
    let keys = answer.as_map().into_iter().flatten().filter_map(|(key, _)| key.as_str());
    let keys: Vec<&str> = keys.take(10).collect();
    if keys.is_empty() { "no fields".into() } else { keys.join(", ") }
}

/// The place of the action that is named, if one is.
fn named(answer: &Value, names: &[&str]) -> Result<Option<usize>, String> {
    let listed = || names.iter().take(LISTED).copied().collect::<Vec<_>>().join(", ");
    if let Some(name) = field(answer, "action").and_then(|action| action.as_str()) {
        let place = names.iter().position(|known| *known == name);
        return place.map(Some).ok_or_else(|| format!("action: {name:?} is none of {}", listed()));
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
    let index = index.filter(|&index| index < names.len());
    index.map(Some).ok_or_else(|| format!("{which}: {place} is no place from 0 to {} ({})", names.len() - 1, listed()))
}

/// What the action is done to, if that is named.
pub(super) fn argument(answer: &Value) -> Option<(&'static str, &Value)> {
    ["argument", "object"].into_iter().find_map(|key| Some((key, field(answer, key)?)))
}

/// The value of the state and how likely the instruction is fulfilled, where they are told.
///
/// # Errors
/// When one is no finite number, or the latter no probability.
pub(super) fn value_and_end(answer: &Value) -> Result<(Option<Values>, Option<f32>), String> {
    let values = scalar(answer, "value")?.map(|state| Values { state, choices: Vec::new() });
    let done = scalar(answer, "done")?;
    if done.is_some_and(|done| !(0.0..=1.0).contains(&done)) {
        return Err("done: it is a probability, from 0 to 1".into());
    }
    Ok((values, done))
}

fn scalar(answer: &Value, which: &str) -> Result<Option<f32>, String> {
    let Some(value) = field(answer, which) else { return Ok(None) };
    let numbers = Numbers::read(value).map_err(|problem| format!("{which}: {problem}"))?;
    match numbers.values[..] {
        [number] if number.is_finite() => Ok(Some(number as f32)),
        [number] => Err(format!("{which}: {number} is no finite number")),
        _ => Err(format!("{which}: it is one number, not {}", numbers.values.len())),
    }
}

/// How likely each action is, where that is told; what is left of those that are possible adds up to 1.
///
/// # Errors
/// When there are too many or too few, one is no such number, or nothing possible has any.
pub(super) fn shares(
    answer: &Value,
    names: &[&str],
    possible: impl Fn(usize) -> bool,
) -> Result<Option<Shares>, String> {
    let Some((which, told)) = ["probabilities", "logits"].into_iter().find_map(|key| Some((key, field(answer, key)?)))
    else {
        return Ok(None);
    };
    let numbers: Vec<Option<f64>> = match told.as_map().filter(|_| field(told, "data").is_none()) {
        Some(pairs) => {
            if let Some((key, _)) = pairs.iter().find(|(key, _)| !names.iter().any(|name| key.as_str() == Some(name))) {
                return Err(format!("{which}: {key} is no action"));
            }
            names.iter().map(|name| field(told, name).map(|value| value.as_f64().unwrap_or(f64::NAN))).collect()
        }
        None => {
            let numbers = Numbers::read(told).map_err(|problem| format!("{which}: {problem}"))?;
            numbers.values.into_iter().map(Some).collect()
        }
    };
    if numbers.len() != names.len() {
        return Err(format!("{which}: {} numbers, but there are {} actions", numbers.len(), names.len()));
    }
    let is_logits = which == "logits";
    for (name, number) in names.iter().zip(&numbers) {
        if let Some(number) = number
            && (number.is_nan() || *number == f64::INFINITY || (*number < 0.0 && !is_logits))
        {
            return Err(format!(
                "{which}: {number} of {name} is no {}",
                if is_logits { "logit" } else { "probability" }
            ));
        }
    }
    let open: Vec<Option<f64>> =
        numbers.into_iter().enumerate().map(|(place, number)| number.filter(|_| possible(place))).collect();
    let highest = open.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
    let weight = |number: f64| if is_logits { (number - highest).exp() } else { number };
    let weights: Vec<Option<f64>> = open.into_iter().map(|number| number.map(weight)).collect();
    let sum: f64 = weights.iter().flatten().sum();
    match sum.is_finite() && sum > 0.0 {
        true => Ok(Some(weights.into_iter().map(|weight| weight.map(|weight| (weight / sum) as f32)).collect())),
        false => Err(format!("{which}: nothing that is possible now has any weight")),
    }
}

/// The place of the likeliest action; the first of equal ones.
pub(super) fn likeliest(shares: &Shares) -> usize {
    let share = |place: usize| shares[place].unwrap_or(-1.0);
    (1..shares.len()).fold(0, |best, place| if share(place) > share(best) { place } else { best })
}
