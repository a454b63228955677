"""From one of Gymnasium's names to an environment that can be served."""

from __future__ import annotations

from typing import Any

import gymnasium

from .environment import CannotDo, Environment
from .gym_environment import GymEnvironment

#: Levels of these names are registered by the package minigrid.
MINIGRID_NAMES = ("BabyAI-", "MiniGrid-")


def make(name: str, tile: int, options: dict[str, Any]) -> Environment:
    """The environment `name`, or `module:name` where importing a module registers it."""
    is_minigrid = name.startswith(MINIGRID_NAMES)
    if is_minigrid:
        import minigrid  # noqa: F401
    env = _make(name, options)
    if is_minigrid:
        from .minigrid_environment import MinigridEnvironment

        return MinigridEnvironment(env, name, tile)
    return GymEnvironment(env, name)


def _make(name: str, options: dict[str, Any]) -> gymnasium.Env:
    try:
        env = gymnasium.make(name, render_mode="rgb_array", disable_env_checker=True, **options)
    except TypeError:
        # Some do not draw, and say so by not taking a mode.
        env = gymnasium.make(name, disable_env_checker=True, **options)
    except (gymnasium.error.Error, ModuleNotFoundError) as problem:
        raise CannotDo(f"{name}: {problem}") from problem
    return env
