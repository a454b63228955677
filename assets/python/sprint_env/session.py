"""One connection's conversation: a request's text in, the answer's text out. No sockets here."""

from __future__ import annotations

import json
import math
import sys
import traceback
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from . import frames
from .environment import CannotDo, Environment, Observation

#: A session that takes a snapshot a step keeps the newest of them.
SNAPSHOTS_KEPT = 4096


class Refused(Exception):
    """A request that is answered with an error of OpenEnv's kinds."""

    def __init__(self, code: str, message: str):
        super().__init__(message)
        self.code = code


class Session:
    """An environment, and what a client has asked of it so far."""

    def __init__(self, environment: Environment):
        self.environment = environment
        self.capabilities = environment.capabilities()
        self.format = frames.formats_of(self.capabilities.frame)[0]
        self.observation: Observation | None = None
        self.episode: str | None = None
        self.steps = 0
        self.snapshots: OrderedDict[str, tuple[Any, int]] = OrderedDict()
        self.taken = 0
        self.requests: dict[str, Callable[[dict[str, Any]], str]] = {
            "reset": self._reset,
            "step": self._step,
            "state": self._state,
            "capabilities": self._capabilities,
            "format": self._format,
            "snapshot": self._snapshot,
            "restore": self._restore,
        }

    def answer(self, text: str | bytes) -> str | None:
        """The answer to a request; None ends the conversation."""
        try:
            kind, data = _parse(text)
            if kind == "close":
                return None
            if kind not in self.requests:
                raise Refused("UNKNOWN_TYPE", f"Unknown message type: {kind}")
            return self.requests[kind](data)
        except Refused as refused:
            return error(str(refused), refused.code)
        except CannotDo as refused:
            return error(str(refused), "EXECUTION_ERROR")
        except Exception as problem:
            traceback.print_exc(file=sys.stderr)
            return error(f"{type(problem).__name__}: {problem}", "EXECUTION_ERROR")

    def _reset(self, data: dict[str, Any]) -> str:
        seed, episode = data.get("seed"), data.get("episode_id", data.get("episode"))
        if not (seed is None or (isinstance(seed, int) and not isinstance(seed, bool) and seed >= 0)):
            raise Refused("VALIDATION_ERROR", f"seed: {seed!r} is not a whole number from 0 on")
        if not (episode is None or isinstance(episode, str)):
            raise Refused("VALIDATION_ERROR", f"episode_id: {episode!r} is not a text")
        self.observation = self.environment.reset(seed, episode)
        self.episode, self.steps = episode, 0
        return self._observed()

    def _step(self, data: dict[str, Any]) -> str:
        if self.observation is None:
            raise CannotDo("no episode has begun: send reset first")
        if self.observation.done:
            raise CannotDo("the episode is over: send reset")
        action, argument = data.get("action"), data.get("argument")
        known = next((known for known in self.capabilities.actions if known.name == action), None)
        if known is None:
            names = ", ".join(known.name for known in self.capabilities.actions)
            raise Refused("VALIDATION_ERROR", f"action: there is no {action!r}, only {names}")
        self._check_argument(known.name, known.argument, argument)
        self.observation = self.environment.step(known.name, argument)
        self.steps += 1
        return self._observed()

    def _check_argument(self, action: str, named: str | None, argument: Any) -> None:
        if named is None:
            if argument is not None:
                raise Refused("VALIDATION_ERROR", f"argument: {action} takes none, but there is {argument!r}")
            return
        if not isinstance(argument, str):
            raise Refused("VALIDATION_ERROR", f"argument: {action} takes a {named}, but there is {argument!r}")
        values = self.capabilities.arguments[named]
        if values is not None and argument not in values:
            raise Refused("VALIDATION_ERROR", f"argument: {argument!r} is no {named}")

    def _state(self, _data: dict[str, Any]) -> str:
        return _message("state", {"episode_id": self.episode, "step_count": self.steps})

    def _capabilities(self, _data: dict[str, Any]) -> str:
        told = asdict(self.capabilities)
        told["formats"] = frames.formats_of(self.capabilities.frame)
        return _message("capabilities", told)

    def _format(self, data: dict[str, Any]) -> str:
        wanted = data.get("format")
        if wanted not in frames.FORMATS:
            raise Refused("VALIDATION_ERROR", f"format: there is no {wanted!r}, only {', '.join(frames.FORMATS)}")
        self.format = wanted
        return self._observed()

    def _snapshot(self, _data: dict[str, Any]) -> str:
        state = self.environment.snapshot()
        self.taken += 1
        name = str(self.taken)
        self.snapshots[name] = (state, self.steps)
        if len(self.snapshots) > SNAPSHOTS_KEPT:
            self.snapshots.popitem(last=False)
        return _message("snapshot", {"id": name})

    def _restore(self, data: dict[str, Any]) -> str:
        name = data.get("id")
        if name not in self.snapshots:
            raise Refused("VALIDATION_ERROR", f"id: no snapshot {name!r} is kept (the newest {SNAPSHOTS_KEPT} are)")
        state, steps = self.snapshots[name]
        self.observation = self.environment.restore(state)
        self.steps = steps
        return self._observed()

    def _observed(self) -> str:
        seen = self.observation or Observation()
        told: dict[str, Any] = {"success": seen.success, "terminated": seen.terminated, "truncated": seen.truncated}
        for name in ("text", "mission", "legal"):
            if (value := getattr(seen, name)) is not None:
                told[name] = value
        if seen.subtasks is not None:
            told["subtasks"] = [{"text": subtask.text, "done": subtask.done} for subtask in seen.subtasks]
        if seen.things is not None:
            told["things"] = [{"name": thing.name, "box": thing.box} for thing in seen.things]
        text = json.dumps(told, allow_nan=False)
        if seen.frame is not None:
            # The frame is most of it, and written without looking for what has to be escaped.
            text = f'{{"frame": {frames.encode(seen.frame, self.format)}, {text[1:]}'
        reward = seen.reward if seen.reward is None or math.isfinite(seen.reward) else None
        end = json.dumps({"reward": reward, "done": seen.done})
        return f'{{"type": "observation", "data": {{"observation": {text}, {end[1:]}}}'


def _message(kind: str, data: dict[str, Any]) -> str:
    return json.dumps({"type": kind, "data": data}, allow_nan=False)


def error(message: str, code: str) -> str:
    """An error's message."""
    return _message("error", {"message": message, "code": code})


def _parse(text: str | bytes) -> tuple[str, dict[str, Any]]:
    try:
        message = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise Refused("INVALID_JSON", f"Invalid JSON: {problem}") from problem
    if not isinstance(message, dict):
        raise Refused("VALIDATION_ERROR", "a message is a JSON object")
    kind, data = message.get("type", ""), message.get("data", {})
    if not isinstance(kind, str) or not isinstance(data, dict):
        raise Refused("VALIDATION_ERROR", "a message has a type, which is a text, and data, which are an object")
    return kind, data
