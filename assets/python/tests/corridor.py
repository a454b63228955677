"""A small environment of the tests' own: a corridor of five cells, a door at its end, and nothing to install."""

from __future__ import annotations

from typing import Any

from sprint_env.environment import Action, CannotDo, Capabilities, Frame, Observation, Subtask, Thing

LENGTH = 5


class Corridor:
    """Solved by opening the door from the last cell."""

    def __init__(self) -> None:
        self.at = 0
        self.is_open = False
        self.is_closed = False

    def capabilities(self) -> Capabilities:
        actions = [Action("back"), Action("ahead"), Action("open", "thing"), Action("say", "words")]
        arguments = {"thing": ["door", "window"], "words": None}
        return Capabilities("Corridor", actions, arguments, snapshot=True, deterministic=True, frame=(2, 1))

    def reset(self, seed: int | None, episode: str | None) -> Observation:
        self.at, self.is_open = (seed or 0) % LENGTH, False
        return self._look()

    def step(self, action: str, argument: str | None) -> Observation:
        match action:
            case "ahead":
                self.at = min(self.at + 1, LENGTH - 1)
            case "back":
                self.at = max(self.at - 1, 0)
            case "open" if self.at < LENGTH - 1:
                raise CannotDo(f"the {argument} is too far away")
            case "open":
                self.is_open = True
            case "say" if argument == "boom":
                raise ZeroDivisionError("boom")
        return self._look()

    def snapshot(self) -> Any:
        return self.at, self.is_open

    def restore(self, state: Any) -> Observation:
        self.at, self.is_open = state
        return self._look()

    def close(self) -> None:
        self.is_closed = True

    def _look(self) -> Observation:
        return Observation(
            frame=Frame(2, 1, bytes([self.at, 0, 0, 0, 0, 255])),
            mission="open the door",
            legal=[self.at > 0, self.at < LENGTH - 1, ["door"] if self.at == LENGTH - 1 else [], True],
            success=self.is_open,
            terminated=self.is_open,
            subtasks=[Subtask("open the door", self.is_open)],
            things=[Thing("door", (0, 0, 1, 1))],
            reward=1.0 if self.is_open else float("nan"),
        )
