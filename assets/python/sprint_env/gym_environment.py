"""Environments of Gymnasium with a discrete set of actions."""

from __future__ import annotations

from enum import EnumMeta
from typing import Any

import gymnasium
import numpy

from .environment import Action, CannotDo, Capabilities, Frame, Observation

#: Keys under which environments and their wrappers tell in `info` that the task is solved.
SUCCESS_KEYS = ("is_success", "success")
#: Keys under which an observation of several parts holds its picture.
PICTURE_KEYS = ("rgb", "pixels", "image")
#: A smaller array is no picture but a grid of codes.
SMALLEST_PICTURE = 16


class GymEnvironment:
    """Any of Gymnasium's environments: its picture is its observation where that is one, else what it renders."""

    def __init__(self, env: gymnasium.Env, name: str):
        if not isinstance(env.action_space, gymnasium.spaces.Discrete):
            raise CannotDo(f"{name} acts in {env.action_space}; only a discrete set of actions can be served")
        self.env = env
        self.name = name
        self.first_action = int(env.action_space.start)
        self.action_names = _action_names(env)
        self.is_seen = _picture_in_space(env.observation_space)
        self.is_rendered = not self.is_seen and env.render_mode == "rgb_array"
        self._size: tuple[int, int] | None = None

    def capabilities(self) -> Capabilities:
        """What Gymnasium tells of it; a picture's size is known from a first one."""
        spec = self.env.spec
        return Capabilities(
            name=self.name,
            actions=[Action(name) for name in self.action_names],
            deterministic=None if spec is None else not spec.nondeterministic,
            frame=self._frame_size(),
        )

    def reset(self, seed: int | None, episode: str | None) -> Observation:
        """Begins the episode that the seed stands for."""
        seen, info = self.env.reset(seed=seed)
        return self._observe(seen, info, Observation())

    def step(self, action: str, argument: str | None) -> Observation:
        """Acts by an action's name."""
        number = self.first_action + self.action_names.index(action)
        seen, reward, terminated, truncated, info = self.env.step(number)
        over = Observation(terminated=bool(terminated), truncated=bool(truncated), reward=float(reward))
        return self._observe(seen, info, over)

    def snapshot(self) -> Any:
        """Gymnasium has no such thing."""
        raise CannotDo(f"{self.name} cannot go back to an earlier state; replay from the seed instead")

    def restore(self, state: Any) -> Observation:
        """Gymnasium has no such thing."""
        raise CannotDo(f"{self.name} cannot go back to an earlier state; replay from the seed instead")

    def close(self) -> None:
        """Closes Gymnasium's environment."""
        self.env.close()

    def _observe(self, seen: Any, info: dict[str, Any], over: Observation) -> Observation:
        over.frame = self._picture(seen)
        if over.frame is None:
            over.text = _in_words(seen)
        if isinstance(seen, dict) and isinstance(seen.get("mission"), str):
            over.mission = seen["mission"]
        if (mask := info.get("action_mask")) is not None:
            over.legal = [bool(possible) for possible in mask]
        told = next((info[key] for key in SUCCESS_KEYS if info.get(key) is not None), None)
        over.success = None if told is None else bool(told)
        return over

    def _picture(self, seen: Any) -> Frame | None:
        if self.is_seen:
            pixels = _find_picture(seen)
        else:
            pixels = self.env.render() if self.is_rendered else None
        return None if pixels is None else frame_of(pixels)

    def _frame_size(self) -> tuple[int, int] | None:
        if self._size is None and (self.is_seen or self.is_rendered):
            seen, _ = self.env.reset(seed=0)
            first = self._picture(seen)
            self._size = None if first is None else (first.width, first.height)
        return self._size


def frame_of(pixels: Any) -> Frame:
    """A picture of rows, columns and colours, or of grey values."""
    pixels = numpy.asarray(pixels)
    if pixels.ndim == 2:
        pixels = pixels[:, :, None]
    if pixels.shape[2] == 1:
        pixels = pixels.repeat(3, axis=2)
    height, width = pixels.shape[:2]
    return Frame(width, height, pixels[:, :, :3].astype(numpy.uint8, copy=False).tobytes())


def _action_names(env: gymnasium.Env) -> list[str]:
    """An environment's own names of its actions, where it has some, else their numbers."""
    space = env.action_space
    inner = env.unwrapped
    named = getattr(inner, "actions", None)
    if isinstance(named, EnumMeta) and len(named) == space.n:
        return [member.name for member in named]
    meanings = getattr(inner, "get_action_meanings", None)
    if callable(meanings) and len(names := meanings()) == space.n == len(set(names)):
        return [str(name).lower() for name in names]
    return [str(int(space.start) + i) for i in range(int(space.n))]


def _picture_in_space(space: gymnasium.Space) -> bool:
    """Whether an observation holds a picture: bytes in rows, columns and one or three colours."""
    if isinstance(space, gymnasium.spaces.Dict):
        return any(key in space.spaces and _picture_in_space(space[key]) for key in PICTURE_KEYS)
    if not isinstance(space, gymnasium.spaces.Box) or space.dtype != numpy.uint8:
        return False
    is_coloured = len(space.shape) == 3 and space.shape[2] in (1, 3)
    return (is_coloured or len(space.shape) == 2) and min(space.shape[:2]) >= SMALLEST_PICTURE


def _find_picture(seen: Any) -> Any:
    if isinstance(seen, dict):
        return next((seen[key] for key in PICTURE_KEYS if key in seen), None)
    return seen


def _in_words(seen: Any) -> str:
    if isinstance(seen, str):
        return seen
    with numpy.printoptions(precision=4, suppress=True):
        return str(seen)
