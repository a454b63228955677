//! What a policy server is told: the frame, the instruction, and what can be done now.

use rmpv::Value;

use super::dialogue::{Protocol, map};
use super::{image, remote};
use crate::agent::policy::Observation;
use crate::domain::{ActionType, Class};
use crate::house::view::Candidate;

/// The classes that an action could name now, nearest first.
pub(super) fn named_classes(candidates: &[Candidate], kind: ActionType) -> Vec<Class> {
    let mut classes = Vec::new();
    for candidate in candidates.iter().filter(|candidate| candidate.kind == kind) {
        if !classes.contains(&candidate.class) {
            classes.push(candidate.class);
        }
    }
    classes
}

/// What stands for each action in the list of what is possible: true, false, or the classes that it could name.
fn legal(candidates: &[Candidate], kind: ActionType) -> Value {
    if !kind.is_interaction() {
        return true.into();
    }
    let classes = named_classes(candidates, kind);
    match classes.is_empty() {
        true => false.into(),
        false => Value::Array(classes.into_iter().map(|class| class.name().into()).collect()),
    }
}

/// The start of an episode.
pub(super) fn episode(here: &Observation<'_>, seed: u64) -> Value {
    let (actions, arguments) = match here.environment.own() {
        Some(view) => remote::actions(view.space),
        None => house_actions(),
    };
    let task = [
        ("name", here.instruction.into()),
        ("environment", here.environment.name().into()),
        ("environment_seed", here.environment.seed().map_or(Value::Nil, Value::from)),
        ("seed", seed.into()),
        ("step", here.step.into()),
    ];
    map([("task", map(task)), ("actions", actions), ("arguments", arguments)])
}

fn house_actions() -> (Value, Value) {
    let actions = ActionType::ALL.map(|kind| {
        let argument = if kind.is_interaction() { "class".into() } else { Value::Nil };
        map([("name", kind.name().into()), ("argument", argument)])
    });
    let classes = Class::all().filter(|class| class.in_vocabulary()).map(|class| class.name().into()).collect();
    (Value::Array(actions.into()), map([("class", Value::Array(classes))]))
}

/// The observation of a step. `carried` is what the server gave to be given back.
///
/// # Errors
/// When the environment fails.
pub(super) fn observation(
    here: &mut Observation<'_>,
    candidates: &[Candidate],
    protocol: Protocol,
    is_local: bool,
    carried: Option<&Value>,
) -> anyhow::Result<Value> {
    let shows = here.environment.own().is_none_or(|view| view.observation.picture.is_some());
    let picture = if shows { image::pack(here.environment.frame()?, protocol, is_local)? } else { Value::Nil };
    let (names, legal, last, text) = match here.environment.own() {
        Some(view) => {
            let names = view.space.actions().iter().map(|action| action.name.as_str().into()).collect();
            let last = here.last.and_then(|action| Some(view.space.parts(action)?.0.into()));
            let text = view.observation.text.as_deref().map(Value::from);
            (Value::Array(names), remote::legal(&view), last, text)
        }
        None => {
            let names = Value::Array(ActionType::ALL.map(|kind| kind.name().into()).into());
            let legal = Value::Array(ActionType::ALL.map(|kind| legal(candidates, kind)).into());
            (names, legal, here.last.map(|action| action.kind.name().into()), None)
        }
    };
    let own = [
        ("step", here.step.into()),
        ("actions", names),
        ("legal", legal),
        ("last_action", last.unwrap_or(Value::Nil)),
        ("text", text.unwrap_or(Value::Nil)),
        ("state", carried.cloned().unwrap_or(Value::Nil)),
    ];
    let protocols_own: [(&str, Value); 2] = match protocol {
        Protocol::VlaEval => [("images", map([("camera", picture)])), ("task_description", here.instruction.into())],
        Protocol::Openpi => [("observation/image", picture), ("prompt", here.instruction.into())],
    };
    let fields = protocols_own.into_iter().chain(own);
    Ok(Value::Map(fields.map(|(name, value)| (name.into(), value)).collect()))
}

/// Adds a field to a map.
pub(super) fn add(map: &mut Value, name: &str, value: Value) {
    if let Value::Map(fields) = map {
        fields.push((name.into(), value));
    }
}
