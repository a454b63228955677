//! JSON Schemas of the files that the program reads and writes, and a check against them that finds every fault.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

/// The schemas by name, as text.
pub const SCHEMAS: [(&str, &str); 6] = [
    ("tasks", include_str!("../../assets/schemas/tasks.json")),
    ("manifest", include_str!("../../assets/schemas/manifest.json")),
    ("episode", include_str!("../../assets/schemas/episode.json")),
    ("summary", include_str!("../../assets/schemas/summary.json")),
    ("comparison", include_str!("../../assets/schemas/comparison.json")),
    ("progress", include_str!("../../assets/schemas/progress.json")),
];

/// A place in a document that departs from its schema.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The field, as in `tasks[1].roles[0].class`; empty for the whole document.
    pub field: String,
    /// What is wrong, and what was expected.
    pub problem: String,
}

/// A schema of that name.
pub fn text(name: &str) -> Option<&'static str> {
    SCHEMAS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Every place in which `document` departs from the schema of that name.
///
/// # Errors
/// When there is no such schema.
pub fn faults(name: &str, document: &Value) -> anyhow::Result<Vec<Fault>> {
    let text = text(name).ok_or_else(|| anyhow::anyhow!("there is no schema {name:?}"))?;
    let root: Value = serde_json::from_str(text)?;
    let mut found = Vec::new();
    Check { root: &root }.value(&root, document, "", &mut found);
    Ok(found)
}

/// The parts of JSON Schema that our schemas use.
struct Check<'a> {
    root: &'a Value,
}

impl Check<'_> {
    fn value(&self, schema: &Value, value: &Value, field: &str, found: &mut Vec<Fault>) {
        let Some(rules) = schema.as_object() else { return };
        let mut fault = |problem: String| found.push(Fault { field: field.to_owned(), problem });
        if let Some(target) = rules.get("$ref").and_then(Value::as_str) {
            if let Some(target) = self.root.pointer(target.trim_start_matches('#')) {
                self.value(target, value, field, found);
            }
            return;
        }
        if let Some(kinds) = rules.get("type")
            && !is_kind(kinds, value)
        {
            return fault(format!("{}, but {} was expected{}", shown(value), kind_words(kinds), about(rules)));
        }
        if let Some(wanted) = rules.get("const")
            && wanted != value
        {
            return fault(format!("{}, but {wanted} was expected", shown(value)));
        }
        if let Some(known) = rules.get("enum").and_then(Value::as_array)
            && !known.contains(value)
        {
            return fault(format!("{}, but one of {} was expected{}", shown(value), list(known, value), about(rules)));
        }
        if let Some(problem) = size(rules, value) {
            fault(problem);
        }
        if let Some(choices) = rules.get("anyOf").and_then(Value::as_array) {
            self.any(choices, rules, value, field, found);
        }
        match value {
            Value::Array(items) => {
                if let Some(schema) = rules.get("items") {
                    for (place, item) in items.iter().enumerate() {
                        self.value(schema, item, &format!("{field}[{place}]"), found);
                    }
                }
            }
            Value::Object(fields) => self.fields(rules, fields, field, found),
            _ => {}
        }
    }

    fn fields(&self, rules: &Map<String, Value>, fields: &Map<String, Value>, field: &str, found: &mut Vec<Fault>) {
        let under = |name: &str| if field.is_empty() { name.to_owned() } else { format!("{field}.{name}") };
        let known = rules.get("properties").and_then(Value::as_object);
        for name in rules.get("required").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str) {
            if !fields.contains_key(name) {
                let schema = known.and_then(|known| known.get(name)).and_then(Value::as_object);
                let about = schema.map(about).unwrap_or_default();
                found.push(Fault { field: under(name), problem: format!("missing{about}") });
            }
        }
        for (name, value) in fields {
            match (known.and_then(|known| known.get(name)), rules.get("additionalProperties")) {
                (Some(schema), _) => self.value(schema, value, &under(name), found),
                (None, Some(Value::Bool(false))) => {
                    let names: Vec<&str> = known.into_iter().flatten().map(|(name, _)| name.as_str()).collect();
                    let problem = format!("there is no such field; known are {}", names.join(", "));
                    found.push(Fault { field: under(name), problem });
                }
                (None, Some(schema)) => self.value(schema, value, &under(name), found),
                (None, None) => {}
            }
        }
    }

    /// The faults of the alternative that comes closest: one that shares a field with the value, else all in words.
    fn any(&self, choices: &[Value], rules: &Map<String, Value>, value: &Value, field: &str, found: &mut Vec<Fault>) {
        let tried: Vec<Vec<Fault>> = choices
            .iter()
            .map(|choice| {
                let mut faults = Vec::new();
                self.value(choice, value, field, &mut faults);
                faults
            })
            .collect();
        if tried.iter().any(Vec::is_empty) {
            return;
        }
        let own: BTreeSet<&String> = value.as_object().into_iter().flat_map(Map::keys).collect();
        let shares = |choice: &Value| {
            let known = choice.get("properties").and_then(Value::as_object);
            known.is_some_and(|known| known.keys().any(|name| own.contains(name)))
        };
        match choices.iter().position(shares) {
            Some(closest) => found.extend(tried.into_iter().nth(closest).unwrap_or_default()),
            None => found.push(Fault {
                field: field.to_owned(),
                problem: format!("{}, but something else was expected{}", shown(value), about(rules)),
            }),
        }
    }
}

fn is_kind(kinds: &Value, value: &Value) -> bool {
    let is = |kind: &Value| match kind.as_str() {
        Some("object") => value.is_object(),
        Some("array") => value.is_array(),
        Some("string") => value.is_string(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("number") => value.is_number(),
        Some("boolean") => value.is_boolean(),
        Some("null") => value.is_null(),
        _ => false,
    };
    kinds.as_array().map_or_else(|| is(kinds), |kinds| kinds.iter().any(is))
}

fn kind_words(kinds: &Value) -> String {
    let word = |kind: &Value| match kind.as_str() {
        Some("object") => "an object {...}",
        Some("array") => "a list [...]",
        Some("string") => "a text",
        Some("integer") => "a whole number",
        Some("number") => "a number",
        Some("boolean") => "true or false",
        _ => "null",
    };
    kinds.as_array().map_or_else(|| word(kinds).into(), |kinds| kinds.iter().map(word).collect::<Vec<_>>().join(" or "))
}

/// Bounds on numbers, texts and lists.
fn size(rules: &Map<String, Value>, value: &Value) -> Option<String> {
    let bound = |name: &str| rules.get(name).and_then(Value::as_f64);
    let (measured, low, high, of) = match value {
        Value::Number(number) => (number.as_f64()?, bound("minimum"), bound("maximum"), ""),
        Value::String(text) => (text.chars().count() as f64, bound("minLength"), bound("maxLength"), " characters"),
        Value::Array(items) => (items.len() as f64, bound("minItems"), bound("maxItems"), " entries"),
        _ => return None,
    };
    if low.is_none_or(|low| measured >= low) && high.is_none_or(|high| measured <= high) {
        return None;
    }
    let (low, high) = (low.map(|v| v.to_string()), high.map(|v| v.to_string()));
    let range = match (low, high) {
        (Some(low), Some(high)) if low == high => format!("exactly {low}"),
        (Some(low), Some(high)) => format!("{low} to {high}"),
        (Some(low), None) => format!("at least {low}"),
        (None, high) => format!("at most {}", high.unwrap_or_default()),
    };
    Some(format!("{measured}{of}, but {range} was expected{}", about(rules)))
}

/// The alternatives; of a long list those that look like the value.
fn list(known: &[Value], value: &Value) -> String {
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    if known.len() <= 16 {
        return known.iter().map(text).collect::<Vec<_>>().join(", ");
    }
    let wanted = text(value).to_lowercase();
    let near = |name: &String| {
        let name = name.to_lowercase();
        wanted.len() >= 2 && (name.starts_with(&wanted[..wanted.floor_char_boundary(2)]) || name.contains(&wanted))
    };
    let mut close: Vec<String> = known.iter().map(text).filter(near).collect();
    close.truncate(8);
    match close.is_empty() {
        true => format!("{} names", known.len()),
        false => format!("{} names, such as {}", known.len(), close.join(", ")),
    }
}

fn about(rules: &Map<String, Value>) -> String {
    rules.get("description").and_then(Value::as_str).map(|about| format!(" ({about})")).unwrap_or_default()
}

/// A value, short enough for a message.
fn shown(value: &Value) -> String {
    let text = match value {
        Value::Object(_) => "an object".into(),
        Value::Array(_) => "a list".into(),
        other => other.to_string(),
    };
    if text.chars().count() <= 60 { text } else { text.chars().take(59).chain(['…']).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::taskset::tests::sample_set;
    use crate::domain::Class;

    fn complaints(change: impl FnOnce(&mut Value)) -> Vec<String> {
        let mut set = serde_json::to_value(sample_set()).unwrap();
        change(&mut set);
        faults("tasks", &set).unwrap().into_iter().map(|fault| format!("{}: {}", fault.field, fault.problem)).collect()
    }

    #[test]
    fn every_fault_is_found_at_once_and_says_what_was_expected() {
        assert_eq!(complaints(|_| ()), Vec::<String>::new());
        let found = complaints(|set| {
            set["tasks"][0]["roles"][0]["class"] = "Aple".into();
            set["tasks"][0]["horizont"] = 3.into();
            set["tasks"][1]["horizon"] = (-1).into();
            set["tasks"][1]["subtasks"][0]["skill"] = "Grab".into();
            set["tasks"][1]["scene"] = serde_json::json!({"generated": {"room": "attic", "seed": 1}});
            set["tasks"][1].as_object_mut().unwrap().remove("instruction");
        });
        let all = found.join("\n");
        assert_eq!(found.len(), 6, "{all}");
        assert!(all.contains("tasks[0].roles[0].class: \"Aple\", but one of 81 names"), "{all}");
        assert!(all.contains("tasks[0].horizont: there is no such field"), "{all}");
        assert!(all.contains("tasks[1].horizon: -1, but 1 to 100000 was expected"), "{all}");
        assert!(all.contains("skill: \"Grab\", but one of Pickup, Put"), "{all}");
        assert!(all.contains("tasks[1].scene.generated.room: \"attic\""), "{all}");
        assert!(all.contains("tasks[1].instruction: missing (What the agent is told)"), "{all}");
    }

    #[test]
    fn the_schema_knows_the_classes_that_an_action_can_name() {
        let schema: Value = serde_json::from_str(text("tasks").unwrap()).unwrap();
        let listed = schema.pointer("/$defs/role/properties/class/enum").unwrap().as_array().unwrap();
        let known: Vec<&str> = Class::all().filter(|class| class.in_vocabulary()).map(Class::name).collect();
        assert_eq!(listed.iter().map(|name| name.as_str().unwrap()).collect::<Vec<_>>(), known);
    }

    #[test]
    fn every_schema_is_json_with_a_title() {
        for (name, text) in SCHEMAS {
            let schema: Value = serde_json::from_str(text).unwrap();
            assert!(schema["title"].is_string(), "{name}");
        }
    }
}
