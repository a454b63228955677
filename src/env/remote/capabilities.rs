//! What an environment in another process can do: as it says itself, or as the schema of its actions shows.

use std::collections::BTreeMap;

use anyhow::{Context, bail, ensure};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::domain::Action;
use crate::env::action_space::{ActionSpace, ArgumentList, NamedAction};

/// What an environment can do.
#[derive(Debug)]
pub(crate) struct Capabilities {
    /// Its own name.
    pub(crate) name: String,
    /// The seed of a reset says where the episode starts; `None` where that is not known.
    pub(crate) seeds: Option<bool>,
    /// It can go back to a state.
    pub(crate) snapshot: bool,
    /// The same seed and actions give the same observations; `None` where that is not known.
    pub(crate) deterministic: Option<bool>,
    /// How its pictures may travel, the first until another is asked for.
    pub(crate) formats: Vec<String>,
    /// The fields that name an action and its argument in a step.
    fields: (String, Option<String>),
}

/// What a server says of itself.
#[derive(Deserialize)]
struct Said {
    name: String,
    actions: Vec<SaidAction>,
    #[serde(default)]
    arguments: BTreeMap<String, Option<Vec<Value>>>,
    seeds: Option<bool>,
    #[serde(default)]
    snapshot: bool,
    deterministic: Option<bool>,
    #[serde(default)]
    formats: Vec<String>,
}

#[derive(Deserialize)]
struct SaidAction {
    name: String,
    argument: Option<String>,
}

impl Capabilities {
    /// Reads what a server says of itself.
    ///
    /// # Errors
    /// Names the field that is wrong.
    pub(super) fn read(data: Value) -> anyhow::Result<(Capabilities, ActionSpace)> {
        let said: Said =
            serde_path_to_error::deserialize(data).map_err(|error| anyhow::anyhow!("capabilities: {error}"))?;
        let names: Vec<&String> = said.arguments.keys().collect();
        let mut actions = Vec::new();
        for (i, action) in said.actions.into_iter().enumerate() {
            let list = action.argument.map(|wanted| {
                let found = names.iter().position(|name| **name == wanted);
                found.with_context(|| format!("capabilities: actions[{i}].argument: there is no list {wanted:?}"))
            });
            actions.push(NamedAction { name: action.name, list: list.transpose()? });
        }
        let lists = said.arguments.into_iter().map(|(name, values)| ArgumentList::new(name, values)).collect();
        let space = ActionSpace::new(actions, lists).context("capabilities")?;
        let Said { name, seeds, snapshot, deterministic, formats, .. } =
            Said { actions: Vec::new(), arguments: BTreeMap::new(), ..said };
        let fields = ("action".into(), Some("argument".into()));
        Ok((Capabilities { name, seeds, snapshot, deterministic, formats, fields }, space))
    }

    /// Reads the schema of a server's actions, where it says nothing of itself.
    ///
    /// # Errors
    /// When its actions are no list of names, with one argument at most.
    pub(super) fn of_schema(schema: &Value, name: String) -> anyhow::Result<(Capabilities, ActionSpace)> {
        let action = schema.get("action").context("/schema has no \"action\"")?;
        let empty = Map::new();
        let properties = action.get("properties").and_then(Value::as_object).unwrap_or(&empty);
        let mut lists: Vec<(&String, Option<Vec<Value>>)> = Vec::new();
        let required = |name: &str| {
            let required = action.get("required").and_then(Value::as_array);
            required.is_some_and(|names| names.iter().any(|it| it == name))
        };
        for (field, property) in properties.iter().filter(|(field, _)| *field != "metadata") {
            match values(property, action) {
                Some(values) => lists.push((field, Some(values))),
                None if property.get("type") == Some(&json!("string")) && required(field) => lists.push((field, None)),
                None => ensure!(
                    !required(field),
                    "its actions need {field:?}, which is no list of names: such an environment cannot be acted in"
                ),
            }
        }
        let place = |wanted: &str| lists.iter().position(|(field, values)| *field == wanted && values.is_some());
        let verb = match lists.len() {
            0 => bail!("its actions have no field that is a list of names"),
            1 => 0,
            2 => {
                let known = ["action", "name", "action_name", "command", "type"].iter().find_map(|field| place(field));
                known.context(
                    "of the two fields of its actions none is named action, name, action_name, command or type",
                )?
            }
            many => bail!("its actions have {many} fields; only a name with one argument is understood"),
        };
        let (field, names) = lists.remove(verb);
        let argument = lists.pop();
        // A lone text is an action that says it.
        let Some(names) = names else {
            let actions = vec![NamedAction { name: field.clone(), list: Some(0) }];
            let space = ActionSpace::new(actions, vec![ArgumentList::new(field.clone(), None)])?;
            return Ok((Capabilities::unknown(name, (String::new(), Some(field.clone()))), space));
        };
        let texts = names.iter().map(|name| name.as_str().map_or_else(|| name.to_string(), str::to_owned));
        let list = argument.is_some().then_some(0);
        let actions = texts.map(|name| NamedAction { name, list }).collect();
        let fields = (field.clone(), argument.as_ref().map(|(field, _)| (*field).clone()));
        let lists = argument.into_iter().map(|(field, values)| ArgumentList::new(field.clone(), values)).collect();
        let space = ActionSpace::new(actions, lists).context("/schema")?;
        Ok((Capabilities::unknown(name, fields), space))
    }

    fn unknown(name: String, fields: (String, Option<String>)) -> Capabilities {
        Capabilities { name, seeds: None, snapshot: false, deterministic: None, formats: Vec::new(), fields }
    }

    /// The data of a step.
    ///
    /// # Errors
    /// When the action is none of the space's.
    pub(super) fn step(&self, space: &ActionSpace, action: Action) -> anyhow::Result<Value> {
        let (name, argument) =
            space.parts(action).with_context(|| format!("{:?} is no action of {}", action, self.name))?;
        let (verb, list) = &self.fields;
        let mut data = Map::new();
        if !verb.is_empty() {
            // A number that stands for an action goes back as a number.
            let number = name.parse::<i64>().ok().filter(|_| verb != "action" || list.is_none());
            data.insert(verb.clone(), number.map_or_else(|| Value::from(name), Value::from));
        }
        if let Some(list) = list {
            data.insert(list.clone(), argument.unwrap_or(Value::Null));
        }
        Ok(Value::Object(data))
    }
}

/// The values that a property may have, where its schema lists them.
fn values(property: &Value, root: &Value) -> Option<Vec<Value>> {
    if let Some(reference) = property.get("$ref").and_then(Value::as_str) {
        return values(root.pointer(reference.strip_prefix('#')?)?, root);
    }
    if let Some(one) = property.get("const") {
        return Some(vec![one.clone()]);
    }
    if let Some(values) = property.get("enum").and_then(Value::as_array) {
        return Some(values.clone());
    }
    let parts = property.get("allOf").and_then(Value::as_array)?;
    if let [part] = &parts[..] { values(part, root) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_server_says_of_itself_is_read_and_checked() {
        let said = json!({"name": "Rooms", "actions": [{"name": "left", "argument": null}, {"name": "open", "argument": "thing"}],
            "arguments": {"text": null, "thing": ["door"]}, "seeds": true, "snapshot": false, "deterministic": null,
            "frame": [56, 56], "formats": ["png", "raw"]});
        let (capabilities, space) = Capabilities::read(said.clone()).unwrap();
        assert_eq!((capabilities.seeds, capabilities.deterministic), (Some(true), None));
        let open = space.find("open", Some(&"door".into())).unwrap();
        assert_eq!(capabilities.step(&space, open).unwrap(), json!({"action": "open", "argument": "door"}));
        let wrong = |path: &str, value: Value| {
            let mut said = said.clone();
            *said.pointer_mut(path).unwrap() = value;
            format!("{:#}", Capabilities::read(said).unwrap_err())
        };
        assert!(wrong("/actions/1/argument", "box".into()).contains("actions[1].argument: there is no list \"box\""));
        assert!(wrong("/actions", json!([])).contains("actions: there is none"));
        assert!(wrong("/actions/0/name", 3.into()).contains("actions[0].name"));
    }

    #[test]
    fn the_actions_of_a_foreign_server_are_read_from_its_schema() {
        let schema = |properties: Value, required: Value| {
            Capabilities::of_schema(
                &json!({"action": {"properties": properties, "required": required,
                "$defs": {"Move": {"enum": ["left", "right"], "type": "string"}}}}),
                "Foreign".into(),
            )
        };
        let metadata = json!({"type": "object"});
        let (lone, space) =
            schema(json!({"metadata": metadata, "move": {"$ref": "#/$defs/Move"}}), json!(["move"])).unwrap();
        assert_eq!(lone.step(&space, space.find("right", None).unwrap()).unwrap(), json!({"move": "right"}));
        let (numbered, space) = schema(json!({"action_id": {"enum": [0, 1]}}), json!(["action_id"])).unwrap();
        assert_eq!(numbered.step(&space, space.find("1", None).unwrap()).unwrap(), json!({"action_id": 1}));
        let two = json!({"command": {"enum": ["take"]}, "thing": {"enum": ["cup", "pan"]}});
        let (two, space) = schema(two, json!(["command", "thing"])).unwrap();
        let take = space.find("take", Some(&"pan".into())).unwrap();
        assert_eq!(two.step(&space, take).unwrap(), json!({"command": "take", "thing": "pan"}));
        let (text, space) = schema(json!({"message": {"type": "string"}}), json!(["message"])).unwrap();
        let say = space.find("message", Some(&"hello".into())).unwrap();
        assert_eq!(text.step(&space, say).unwrap(), json!({"message": "hello"}));
        let refused = schema(json!({"torque": {"type": "number"}}), json!(["torque"])).unwrap_err().to_string();
        assert!(refused.contains("\"torque\", which is no list of names"), "{refused}");
    }
}
