//! In what the sizes of two networks differ, in words.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

/// Each size that differs, as `size: the one's, not the other's`. Dropout is no matter of size.
pub(crate) fn size_differences<S: Serialize>(one: &S, other: &S) -> String {
    let sizes = |spec: &S| {
        let mut sizes = BTreeMap::new();
        note("", &serde_json::to_value(spec).unwrap_or_default(), &mut sizes);
        sizes
    };
    let (one, other) = (sizes(one), sizes(other));
    let names: std::collections::BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    let none = "none".to_owned();
    let differs = |name: &String| {
        let (own, others) = (one.get(name).unwrap_or(&none), other.get(name).unwrap_or(&none));
        (own != others).then(|| format!("{name}: {own}, not {others}"))
    };
    names.into_iter().filter_map(differs).collect::<Vec<_>>().join("; ")
}

/// Notes a size by its name in words; a list of sizes is one.
fn note(name: &str, value: &Value, sizes: &mut BTreeMap<String, String>) {
    let text = match value {
        Value::Object(fields) => {
            for (field, value) in fields.iter().filter(|(field, _)| *field != "dropout") {
                note(format!("{name} {field}").trim(), value, sizes);
            }
            return;
        }
        Value::Array(list) => list.iter().map(Value::to_string).collect::<Vec<_>>().join("-"),
        Value::Bool(is_so) => if *is_so { "yes" } else { "no" }.to_owned(),
        Value::Null => return,
        Value::String(text) => text.clone(),
        Value::Number(number) => number.to_string(),
    };
    sizes.insert(name.replace('_', " "), text);
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn sizes_that_differ_are_told_in_words() {
        let small = json!({"history": 5, "hidden": [8], "dropout": 0.1, "attention": null, "goal_channels": [4, 4]});
        let large = json!({"history": 5, "hidden": [512, 256], "dropout": 0.5, "attention": {"layers": 2}});
        let told = "attention layers: none, not 2; goal channels: 4-4, not none; hidden: 8, not 512-256";
        assert_eq!(size_differences(&small, &large), told);
        assert_eq!(size_differences(&small, &small), "");
    }
}
