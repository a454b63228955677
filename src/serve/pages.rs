//! The pages that OpenEnv's servers show beside the sessions: health, schemas, and what the environment is.

use serde_json::{Value, json};

use super::json::{CLASSES, class_names};
use crate::domain::ActionType;

/// A page's JSON, if there is one of that path.
pub(super) fn page(path: &str) -> Option<Value> {
    match path {
        "/health" => Some(json!({"status": "healthy"})),
        "/schema" => Some(schemas()),
        "/metadata" => Some(json!({
            "name": "House",
            "description": "Household tasks described in words, in generated and imported floor plans",
            "version": env!("CARGO_PKG_VERSION"),
        })),
        _ => None,
    }
}

fn schemas() -> Value {
    let text = json!({"type": "string"});
    let flag = json!({"type": "boolean"});
    let list = |items: &Value| json!({"type": "array", "items": items});
    let classes: Vec<Value> = class_names().into_iter().map(Value::from).chain([Value::Null]).collect();
    json!({
        "action": {
            "type": "object",
            "properties": {
                "action": {"enum": ActionType::ALL.map(ActionType::name)},
                "argument": {"enum": classes, "description": format!("the {CLASSES} of what an interaction acts on")},
            },
            "required": ["action"],
        },
        "observation": {
            "type": "object",
            "properties": {
                "frame": {
                    "type": "object",
                    "properties": {
                        "encoding": {"enum": ["png", "raw"]},
                        "width": {"type": "integer"},
                        "height": {"type": "integer"},
                        "data": {"type": "string", "contentEncoding": "base64"},
                    },
                    "required": ["encoding", "width", "height", "data"],
                },
                "mission": text,
                "legal": list(&json!({"anyOf": [flag, list(&text)]})),
                "success": flag,
                "terminated": flag,
                "truncated": flag,
                "subtasks": list(&json!({"type": "object", "properties": {"text": text, "done": flag}})),
                "things": list(&json!({
                    "type": "object",
                    "properties": {
                        "name": text,
                        "box": {"type": "array", "items": {"type": "integer"}, "minItems": 4, "maxItems": 4},
                    },
                })),
            },
            "required": ["frame", "mission", "success", "terminated", "truncated", "subtasks", "things"],
        },
        "state": {
            "type": "object",
            "properties": {"episode_id": {"type": ["string", "null"]}, "step_count": {"type": "integer"}},
        },
    })
}
