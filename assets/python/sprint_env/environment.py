"""What every environment behind the server offers, whatever package it comes from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol


class CannotDo(Exception):
    """A request that this environment cannot carry out now. Its text is for whoever asked; nothing has changed."""


@dataclass(frozen=True)
class Action:
    """An action by name; `argument` names the list of values that it takes one of."""

    name: str
    argument: str | None = None


@dataclass(frozen=True)
class Capabilities:
    """What an environment can do, told before the first episode."""

    name: str
    actions: list[Action]
    #: The values of each list that an action's argument names; None in place of a list where any text may be said.
    arguments: dict[str, list[str] | None] = field(default_factory=dict)
    seeds: bool = True
    snapshot: bool = False
    #: Whether the same seed and actions give the same observations; None where that is unknown.
    deterministic: bool | None = None
    #: Width and height of its pictures.
    frame: tuple[int, int] | None = None


@dataclass(frozen=True)
class Frame:
    """A picture as rows of RGB bytes from the top."""

    width: int
    height: int
    rgb: bytes


@dataclass(frozen=True)
class Subtask:
    """A part of what is asked."""

    text: str
    done: bool


@dataclass(frozen=True)
class Thing:
    """Something in view; `box` is x0, y0, x1, y1 in pixels of the frame."""

    name: str
    box: tuple[int, int, int, int]


@dataclass
class Observation:
    """What the agent gets after a reset or a step. None means that the environment does not tell."""

    frame: Frame | None = None
    text: str | None = None
    mission: str | None = None
    #: An entry for each action: possible or not, or the argument's values that are possible.
    legal: list[bool | list[str]] | None = None
    success: bool | None = None
    terminated: bool = False
    truncated: bool = False
    subtasks: list[Subtask] | None = None
    things: list[Thing] | None = None
    reward: float | None = None

    @property
    def done(self) -> bool:
        """Whether the episode is over."""
        return self.terminated or self.truncated


class Environment(Protocol):
    """An environment that a session plays in."""

    def capabilities(self) -> Capabilities:
        """What it can do; the same at any time."""

    def reset(self, seed: int | None, episode: str | None) -> Observation:
        """Begins an episode."""

    def step(self, action: str, argument: str | None) -> Observation:
        """Acts; raises `CannotDo` for an action that it does not have."""

    def snapshot(self) -> Any:
        """The present state, for `restore`; raises `CannotDo` where it cannot."""

    def restore(self, state: Any) -> Observation:
        """Goes back to a state of `snapshot`."""

    def close(self) -> None:
        """Gives back what it holds; may be called from another thread."""
