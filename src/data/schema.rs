//! Checks a document against a JSON Schema, and says in words what is wrong at which field.

use jsonschema::ValidationError;
use jsonschema::error::ValidationErrorKind;
use serde_json::{Map, Value};

/// A place in a document that departs from its schema.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The field, as in `tasks[1].roles[0].class`; empty for the whole document.
    pub(crate) field: String,
    /// What is wrong, and what was expected.
    pub(crate) problem: String,
}

/// Every place in which `document` departs from `schema`.
///
/// # Errors
/// When `schema` is no JSON Schema.
pub fn faults(schema: &Value, document: &Value) -> anyhow::Result<Vec<Fault>> {
    let validator = jsonschema::validator_for(schema).map_err(|error| anyhow::anyhow!("not a JSON Schema: {error}"))?;
    let mut found = Vec::new();
    for error in validator.iter_errors(document) {
        explain(schema, &error, &mut found);
    }
    Ok(found)
}

/// Puts a validator's error into words.
fn explain(schema: &Value, error: &ValidationError<'_>, found: &mut Vec<Fault>) {
    let (field, value) = (field_name(error.instance_path().as_str()), error.instance());
    let under = |name: &str| if field.is_empty() { name.to_owned() } else { format!("{field}.{name}") };
    let none = Map::new();
    let rules = rules_of(schema, error).unwrap_or(&none);
    let properties = |rules: &Map<String, Value>| rules.get("properties").and_then(Value::as_object).cloned();
    let whole = || properties(around(schema, error)?);
    let known = properties(rules).or_else(whole).unwrap_or_default();
    let problem = match error.kind() {
        ValidationErrorKind::AnyOf { context } | ValidationErrorKind::OneOfNotValid { context } => {
            return explain_alternatives(schema, error, context, found);
        }
        ValidationErrorKind::Required { property } => {
            let name = property.as_str().unwrap_or_default();
            let about = known.get(name).and_then(Value::as_object).map(about).unwrap_or_default();
            found.push(Fault { field: under(name), problem: format!("missing{about}") });
            return;
        }
        ValidationErrorKind::AdditionalProperties { unexpected } => {
            let names: Vec<&str> = known.keys().map(String::as_str).collect();
            let problem = format!("there is no such field; known are {}", names.join(", "));
            found.extend(unexpected.iter().map(|name| Fault { field: under(name), problem: problem.clone() }));
            return;
        }
        ValidationErrorKind::Type { .. } => {
            let kinds = rules.get("type").map(kind_words).unwrap_or_default();
            format!("{}, but {kinds} was expected{}", shown(value), about(rules))
        }
        ValidationErrorKind::Constant { expected_value } => {
            format!("{}, but {expected_value} was expected", shown(value))
        }
        ValidationErrorKind::Enum { options } => {
            let options = options.as_array().map(Vec::as_slice).unwrap_or_default();
            format!("{}, but one of {} was expected{}", shown(value), list(options, value), about(rules))
        }
        _ => size(rules, value).unwrap_or_else(|| error.to_string()),
    };
    found.push(Fault { field, problem });
}

/// The faults of the alternative that the value comes closest to: the one that it departs from furthest inside.
fn explain_alternatives(
    schema: &Value,
    error: &ValidationError<'_>,
    alternatives: &[Vec<ValidationError<'static>>],
    found: &mut Vec<Fault>,
) {
    let own = error.instance_path().as_str().len();
    let depth = |errors: &Vec<ValidationError<'static>>| {
        errors.iter().map(|error| error.instance_path().as_str().len()).max().unwrap_or(0)
    };
    if let Some(closest) = alternatives.iter().filter(|errors| depth(errors) > own).max_by_key(|errors| depth(errors)) {
        return closest.iter().for_each(|error| explain(schema, error, found));
    }
    let constant = |error: &ValidationError<'static>| match error.kind() {
        ValidationErrorKind::Constant { expected_value } => Some((**expected_value).clone()),
        _ => None,
    };
    let constants: Vec<Value> = alternatives.iter().flatten().filter_map(constant).collect();
    let expected = match constants.is_empty() {
        true => "something else".into(),
        false => format!("one of {}", list(&constants, error.instance())),
    };
    let about = rules_of(schema, error).map(about).unwrap_or_default();
    let problem = format!("{}, but {expected} was expected{about}", shown(error.instance()));
    found.push(Fault { field: field_name(error.instance_path().as_str()), problem });
}

/// The part of the schema that an error departs from.
fn rules_of<'a>(schema: &'a Value, error: &ValidationError<'_>) -> Option<&'a Map<String, Value>> {
    let (rules, _keyword) = error.schema_path().as_str().rsplit_once('/')?;
    schema.pointer(rules)?.as_object()
}

/// The schema around a branch (`then`, `else`) that an error departs from: a branch describes no fields of its own.
fn around<'a>(schema: &'a Value, error: &ValidationError<'_>) -> Option<&'a Map<String, Value>> {
    let (rules, _keyword) = error.schema_path().as_str().rsplit_once('/')?;
    let (whole, branch) = rules.rsplit_once('/')?;
    matches!(branch, "then" | "else").then(|| schema.pointer(whole)?.as_object()).flatten()
}

/// A JSON pointer as people write it: `tasks[1].roles[0].class`.
fn field_name(pointer: &str) -> String {
    let mut field = String::new();
    for part in pointer.split('/').skip(1) {
        let part = part.replace("~1", "/").replace("~0", "~");
        match part.parse::<usize>() {
            Ok(index) => field += &format!("[{index}]"),
            Err(_) if field.is_empty() => field = part,
            Err(_) => field += &format!(".{part}"),
        }
    }
    field
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
    rules
        .get("description")
        .and_then(Value::as_str)
        .map(|about| format!(" ({})", about.trim_end_matches('.')))
        .unwrap_or_default()
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
    use crate::data::taskset::{LONGEST_HORIZON, MOST_SUBTASKS};
    use crate::domain::{Class, TaskSet};

    fn task_schema() -> Value {
        schemars::schema_for!(TaskSet).to_value()
    }

    fn complaints(change: impl FnOnce(&mut Value)) -> Vec<String> {
        let mut set = serde_json::to_value(sample_set()).unwrap();
        change(&mut set);
        let found = faults(&task_schema(), &set).unwrap();
        found.into_iter().map(|fault| format!("{}: {}", fault.field, fault.problem)).collect()
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
        assert!(all.contains("tasks[1].instruction: missing (What the agent is told"), "{all}");
    }

    #[test]
    fn a_value_that_fits_no_alternative_is_told_what_does() {
        let told = complaints(|set| set["tasks"][0]["start"]["agent"]["heading"] = "up".into()).join("\n");
        assert!(told.contains("tasks[0].start.agent.heading: \"up\", but one of north, east"), "{told}");
        let told = complaints(|set| set["tasks"][0]["scene"] = 7.into()).join("\n");
        assert!(told.contains("tasks[0].scene: 7, but something else was expected"), "{told}");
    }

    #[test]
    fn the_schema_knows_the_classes_that_an_action_can_name() {
        let schema = task_schema();
        let listed = schema.pointer("/$defs/Role/properties/class/enum").unwrap().as_array().unwrap();
        let known: Vec<&str> = Class::all().filter(|class| class.in_vocabulary()).map(Class::name).collect();
        assert_eq!(listed.iter().map(|name| name.as_str().unwrap()).collect::<Vec<_>>(), known);
    }

    #[test]
    fn the_schema_has_the_limits_that_the_reader_has() {
        let schema = task_schema();
        let limit = |field: &str| schema.pointer(&format!("/$defs/Task/properties/{field}")).unwrap().as_u64().unwrap();
        assert_eq!(limit("horizon/maximum"), u64::from(LONGEST_HORIZON));
        assert_eq!([limit("roles/maxItems"), limit("subtasks/maxItems")], [MOST_SUBTASKS as u64; 2]);
    }
}
