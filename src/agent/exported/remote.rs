//! An exported policy in an environment with actions of its own.

use anyhow::ensure;
use rand::Rng;
use serde_json::Value;

use super::answer::{Answer, softmax};
use super::spec::PolicySpec;
use crate::agent::decision::Decision;
use crate::agent::select::Selection;
use crate::domain::Action;
use crate::env::action_space::ActionSpace;
use crate::env::remote_view::RemoteView;

/// Checks that the environment has all actions of a description.
///
/// # Errors
/// Names the first that it has not.
pub(super) fn check(spec: &PolicySpec, space: &ActionSpace) -> anyhow::Result<()> {
    let known: Vec<&str> = space.actions().iter().map(|action| action.name.as_str()).collect();
    let strange = spec.actions.iter().find(|name| !known.contains(&name.as_str()));
    ensure!(
        strange.is_none(),
        "its action {:?} is none of the environment's: {}",
        strange.map_or("", String::as_str),
        known[..known.len().min(LISTED)].join(", ")
    );
    Ok(())
}

/// Names that a refusal lists.
const LISTED: usize = 30;

/// The decision: of the possible actions the likeliest, then its likeliest argument; or both by chance.
///
/// # Errors
/// When nothing that it knows is possible.
pub(super) fn decide(
    answer: &Answer,
    spec: &PolicySpec,
    view: &RemoteView<'_>,
    mut selection: Selection<'_>,
) -> anyhow::Result<Decision> {
    let mut open: Vec<(f32, Vec<(Action, f32)>)> = Vec::new();
    for possible in view.possible() {
        let name = &view.space.actions()[usize::from(possible.action)].name;
        let Some(place) = spec.actions.iter().position(|known| known == name) else { continue };
        let actions = possible.actions();
        let logits: Vec<f32> = actions.iter().map(|&action| argument_logit(action, answer, spec, view)).collect();
        // An action whose arguments are all unknown cannot be done.
        if let Ok(shares) = softmax(&logits) {
            open.push((answer.actions[place], actions.into_iter().zip(shares).collect()));
        }
    }
    ensure!(!open.is_empty(), "nothing that it knows is possible here");
    let shares = softmax(&open.iter().map(|(logit, _)| *logit).collect::<Vec<_>>())?;
    let (_, arguments) = &open[pick(&shares, &mut selection)];
    let (action, _) = arguments[pick(&arguments.iter().map(|(_, share)| *share).collect::<Vec<_>>(), &mut selection)];
    let whole = open.iter().zip(&shares);
    let own = whole.flat_map(|((_, with), share)| with.iter().map(move |(action, part)| (*action, share * part)));
    Ok(Decision { own: Some(own.collect()), ..Decision::of(action) })
}

/// The logit of what an action is done to; all alike where the policy tells none.
fn argument_logit(action: Action, answer: &Answer, spec: &PolicySpec, view: &RemoteView<'_>) -> f32 {
    let argument = view.space.parts(action).and_then(|(_, argument)| argument);
    let Some(argument) = argument.filter(|_| !spec.arguments.is_empty()) else { return 0.0 };
    let words = match argument {
        Value::String(text) => text,
        other => other.to_string(),
    };
    let place = spec.arguments.iter().position(|known| *known == words);
    place.map_or(f32::NEG_INFINITY, |place| answer.arguments[place])
}

/// The place of the likeliest share, the first of equal ones; or one by chance.
fn pick(shares: &[f32], selection: &mut Selection<'_>) -> usize {
    match selection {
        Selection::Greedy => (1..shares.len()).fold(0, |best, at| if shares[at] > shares[best] { at } else { best }),
        Selection::Sample(rng) => {
            let mut left = rng.random::<f32>() * shares.iter().sum::<f32>();
            let reached = shares.iter().position(|share| {
                left -= share;
                left < 0.0
            });
            reached.unwrap_or_else(|| shares.iter().rposition(|&share| share > 0.0).unwrap_or(0))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use serde_json::json;

    use super::*;
    use crate::env::action_space::tests::space;
    use crate::env::observation::{Legal, RemoteObservation};

    fn decided(actions: &[&str], logits: &[f32], arguments: &[(&str, f32)]) -> anyhow::Result<(String, Vec<f32>)> {
        let names: Vec<&str> = arguments.iter().map(|(name, _)| *name).collect();
        let spec: PolicySpec = serde_json::from_value(
            json!({"format_version": 1, "frames": {"height": 2, "width": 2}, "actions": actions, "arguments": names}),
        )?;
        let legal = Some(vec![Legal::Whole(true), Legal::Whole(false), Legal::Whole(true), Legal::Whole(false)]);
        let (space, observation) = (Arc::new(space()), RemoteObservation { legal, ..RemoteObservation::default() });
        let arguments = arguments.iter().map(|(_, logit)| *logit).collect();
        let answer = Answer { actions: logits.to_vec(), arguments, value: None };
        let view = RemoteView { space: &space, observation: &observation };
        let made = decide(&answer, &spec, &view, Selection::Greedy)?;
        let shares = made.own.unwrap_or_default().into_iter().map(|(_, share)| share).collect();
        Ok((space.words(made.action), shares))
    }

    #[test]
    fn the_likeliest_possible_action_is_taken_with_its_likeliest_argument() {
        let (done, shares) =
            decided(&["left", "forward", "open"], &[1.0, 9.0, 1.0], &[("7", 3.0), ("door", 3.0)]).unwrap();
        assert_eq!((done.as_str(), shares), ("left", vec![0.5, 0.25, 0.25]), "forward is likelier, but impossible");
        let (done, _) = decided(&["left", "open"], &[0.0, 1.0], &[("door", 0.0), ("7", 1.0)]).unwrap();
        assert_eq!(done, "open 7");
        let (done, _) = decided(&["open"], &[0.0], &[]).unwrap();
        assert_eq!(done, "open door", "the first, where none is told");
        let (done, _) = decided(&["left", "open"], &[0.0, 1.0], &[("window", 0.0)]).unwrap();
        assert_eq!(done, "left", "nothing that it could open is known to it");
    }

    #[test]
    fn what_it_cannot_do_here_is_an_error_and_actions_that_there_are_not_are_named() {
        let refusal = |actions: &[&str], logits: &[f32]| decided(actions, logits, &[]).unwrap_err().to_string();
        assert!(refusal(&["forward"], &[1.0]).contains("nothing that it knows is possible"));
        assert!(refusal(&["left"], &[f32::NEG_INFINITY]).contains("masks everything"));
        let spec = serde_json::from_value(
            json!({"format_version": 1, "frames": {"height": 2, "width": 2}, "actions": ["left", "fly"]}),
        );
        let told = check(&spec.unwrap(), &space()).unwrap_err().to_string();
        assert_eq!(told, "its action \"fly\" is none of the environment's: left, forward, open, say");
    }
}
