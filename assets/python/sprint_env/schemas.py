"""The JSON Schemas that the server shows at `/schema`, as OpenEnv's servers do."""

from __future__ import annotations

from typing import Any

from .environment import Capabilities

TEXT_OR_NULL = {"type": ["string", "null"]}
BOOL_OR_NULL = {"type": ["boolean", "null"]}


def schemas(capabilities: Capabilities) -> dict[str, Any]:
    """Of actions, observations and the state."""
    return {"action": _action(capabilities), "observation": OBSERVATION, "state": STATE}


def _action(capabilities: Capabilities) -> dict[str, Any]:
    properties: dict[str, Any] = {"action": {"enum": [action.name for action in capabilities.actions]}}
    values = capabilities.arguments.values()
    if any(known is None for known in values):
        properties["argument"] = TEXT_OR_NULL
    elif values:
        listed = sorted({value for known in values for value in known or []})
        properties["argument"] = {"enum": [*listed, None]}
    return {"type": "object", "properties": properties, "required": ["action"]}


OBSERVATION: dict[str, Any] = {
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
        "text": {"type": "string"},
        "mission": {"type": "string"},
        "legal": {
            "type": "array",
            "items": {"anyOf": [{"type": "boolean"}, {"type": "array", "items": {"type": "string"}}]},
        },
        "success": BOOL_OR_NULL,
        "terminated": {"type": "boolean"},
        "truncated": {"type": "boolean"},
        "subtasks": {
            "type": "array",
            "items": {"type": "object", "properties": {"text": {"type": "string"}, "done": {"type": "boolean"}}},
        },
        "things": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    "name": {"type": "string"},
                    "box": {"type": "array", "items": {"type": "integer"}, "minItems": 4, "maxItems": 4},
                },
            },
        },
    },
    "required": ["success", "terminated", "truncated"],
}

STATE: dict[str, Any] = {
    "type": "object",
    "properties": {"episode_id": TEXT_OR_NULL, "step_count": {"type": "integer"}},
}
