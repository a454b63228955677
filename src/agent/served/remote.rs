//! Environments whose actions are their own, as a policy server hears of them and answers.

use anyhow::Context;
use rmpv::Value;

use super::answer::{argument, chosen, shares, value_and_end};
use super::array::field;
use super::dialogue::map;
use crate::agent::decision::Decision;
use crate::domain::Action;
use crate::env::action_space::ActionSpace;
use crate::env::remote_view::{Possible, RemoteView};

/// The actions, a map each, and the lists of arguments.
pub(super) fn actions(space: &ActionSpace) -> (Value, Value) {
    let mut lists: Vec<(Value, Value)> = Vec::new();
    let actions = space.actions().iter().enumerate().map(|(place, action)| {
        let argument = space.list(place).map_or(Value::Nil, |list| {
            let name: Value = list.name.as_str().into();
            if lists.iter().all(|(known, _)| *known != name) {
                // Any text may be said of an open one.
                let values = if list.is_open { Value::Nil } else { told_all(&list.values()) };
                lists.push((name.clone(), values));
            }
            name
        });
        map([("name", action.name.as_str().into()), ("argument", argument)])
    });
    let actions = Value::Array(actions.collect());
    (actions, Value::Map(lists))
}

fn told_all(values: &[serde_json::Value]) -> Value {
    Value::Array(values.iter().map(told).collect())
}

/// A value of an argument.
fn told(value: &serde_json::Value) -> Value {
    match value {
        serde_json::Value::String(text) => text.as_str().into(),
        serde_json::Value::Bool(is) => (*is).into(),
        serde_json::Value::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(whole), _) => whole.into(),
            (None, Some(number)) => number.into(),
            _ => Value::Nil,
        },
        other => other.to_string().into(),
    }
}

/// What stands for each action in the list of what is possible: true, false, or the arguments that it could have.
pub(super) fn legal(view: &RemoteView<'_>) -> Value {
    let possible = view.possible();
    let entry = |place: usize| match possible.iter().find(|one| usize::from(one.action) == place) {
        None => false.into(),
        Some(Possible { with: None, .. }) => true.into(),
        Some(Possible { with: Some(actions), .. }) => {
            let arguments = actions.iter().filter_map(|&action| view.space.parts(action)?.1);
            Value::Array(arguments.map(|argument| told(&argument)).collect())
        }
    };
    Value::Array((0..view.space.actions().len()).map(entry).collect())
}

/// The decision that an answer holds.
///
/// # Errors
/// Says which field is wrong and what it may be.
pub(super) fn decision(answer: &Value, view: &RemoteView<'_>) -> Result<Decision, String> {
    let names: Vec<&str> = view.space.actions().iter().map(|action| action.name.as_str()).collect();
    let possible = view.possible();
    let one = |place: usize| possible.iter().find(|one| usize::from(one.action) == place);
    let shares = shares(answer, &names, |place| one(place).is_some())?;
    let place = chosen(answer, &names, shares.as_ref())?;
    let action = complete(answer, names[place], one(place), view).map_err(|error| format!("{error:#}"))?;
    let own = shares.map(|shares| {
        let each = |(place, share): (usize, Option<f32>)| {
            let actions: Vec<Action> = one(place).map_or(Vec::new(), Possible::actions);
            let part = share.unwrap_or(0.0) / actions.len().max(1) as f32;
            actions.into_iter().map(move |action| (action, part))
        };
        shares.into_iter().enumerate().flat_map(each).collect()
    });
    let (values, done) = value_and_end(answer)?;
    Ok(Decision { own, values, done, ..Decision::of(action) })
}

/// Adds the argument: the named one, else the likeliest of those that are possible, else the first.
fn complete(answer: &Value, name: &str, possible: Option<&Possible>, view: &RemoteView<'_>) -> anyhow::Result<Action> {
    if let Some((which, said)) = argument(answer) {
        let value = heard(said).with_context(|| format!("{which}: it is neither text nor a number"))?;
        return view.space.find(name, Some(&value));
    }
    let open = possible.and_then(|one| one.with.as_ref());
    let weight = |action: &Action| {
        let weights = field(answer, "argument_probabilities")?;
        let key = told(&view.space.parts(*action)?.1?);
        let found = weights.as_map()?.iter().find(|(known, _)| *known == key);
        found?.1.as_f64().filter(|weight| weight.is_finite())
    };
    let best = open.and_then(|actions| {
        let likelier = |a: Action, b: &Action| if weight(b) > weight(&a) { *b } else { a };
        Some(actions[1..].iter().fold(*actions.first()?, likelier))
    });
    // Without an argument where one is needed, the space says what there is.
    best.map_or_else(|| view.space.find(name, None), Ok)
}

fn heard(value: &Value) -> Option<serde_json::Value> {
    let whole = || value.as_i64().map(serde_json::Value::from);
    value.as_str().map(serde_json::Value::from).or_else(whole).or_else(|| value.as_f64().map(serde_json::Value::from))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::env::action_space::tests::space;
    use crate::env::observation::{Legal, RemoteObservation};

    fn decided<const N: usize>(fields: [(&str, Value); N], legal: Option<Vec<Legal>>) -> Result<Decision, String> {
        let (space, observation) = (Arc::new(space()), RemoteObservation { legal, ..RemoteObservation::default() });
        decision(&map(fields), &RemoteView { space: &space, observation: &observation })
    }

    fn done<const N: usize>(fields: [(&str, Value); N]) -> String {
        let made = decided(fields, None).unwrap();
        space_with(made.action)
    }

    /// An action in words; a text that was said is in no other space.
    fn space_with(action: Action) -> String {
        let space = space();
        let _ = space.find("say", Some(&"hello".into()));
        space.words(action)
    }

    #[test]
    fn actions_are_named_or_numbered_with_arguments_of_their_own() {
        assert_eq!(done([("action", "forward".into())]), "forward");
        assert_eq!(done([("action", 0.into())]), "left");
        assert_eq!(done([("action", "open".into()), ("argument", 7.into())]), "open 7");
        assert_eq!(done([("action", "say".into()), ("argument", "hello".into())]), "say hello");
        assert_eq!(done([("action", "open".into())]), "open door", "the first, where none is named");
        let weights = map([("door", 0.2.into())]);
        assert_eq!(done([("action", "open".into()), ("argument_probabilities", weights)]), "open door");
    }

    #[test]
    fn what_is_impossible_now_has_no_share_and_what_there_is_not_is_refused() {
        let legal = || Some(vec![Legal::Whole(true), Legal::Whole(false), Legal::Whole(true), Legal::Whole(false)]);
        let weights = Value::Array([0.2, 0.6, 0.2, 0.0].map(Value::from).into());
        let made = decided([("probabilities", weights)], legal()).unwrap();
        assert_eq!(space_with(made.action), "left", "forward is likelier, but impossible");
        let shares: Vec<f32> = made.own.unwrap().into_iter().map(|(_, share)| share).collect();
        assert_eq!(shares, [0.5, 0.25, 0.25], "left, and both things that could be opened");
        let refusal = |fields| decided::<1>(fields, None).unwrap_err();
        assert!(refusal([("action", "jump".into())]).contains("\"jump\" is none of left, forward, open, say"));
        assert!(refusal([("action", 4.into())]).contains("no place from 0 to 3"));
        assert!(refusal([("probabilities", Value::Array(vec![1.into()]))]).contains("there are 4 actions"));
    }

    #[test]
    fn a_server_hears_of_lists_and_of_what_is_possible() {
        let (space, observation) = (Arc::new(space()), RemoteObservation::default());
        let (told, lists) = actions(&space);
        assert_eq!(field(&told.as_array().unwrap()[2], "argument").and_then(|name| name.as_str()), Some("thing"));
        let things = Value::Array(vec!["door".into(), 7.into()]);
        assert_eq!(field(&lists, "thing"), Some(&things));
        let legal = legal(&RemoteView { space: &space, observation: &observation });
        assert_eq!(legal, Value::Array(vec![true.into(), true.into(), things, false.into()]));
    }
}
