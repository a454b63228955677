"""BabyAI's own bot as a policy.

The bot plans on the level itself, which no picture shows whole, so it plays in a copy of its own. Which level that has to be
a copy of is recognised by the pictures: those of every seed that it is told to expect are compared with what it sees.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from minigrid.utils.baby_ai_bot import BabyAIBot

from .environment import CannotDo
from .gym_environment import frame_of
from .make_gym import make
from .minigrid_environment import MinigridEnvironment


class BabyAIBotPolicy:
    """Call `begin` where an episode begins, then the policy itself with what is seen at each step."""

    def __init__(self, level: str, seeds: Iterable[int], tile: int = 8):
        self.level = level
        self.tile = tile
        #: The seeds of the levels that begin with a picture and a mission.
        self.known: dict[tuple[bytes, str], list[int]] = {}
        environment = self._make()
        self.actions = environment.action_names
        for seed in seeds:
            seen = environment.reset(seed, None)
            self.known.setdefault((seen.frame.rgb, seen.mission), []).append(seed)
        self.copies: list[_Copy] | None = None

    def begin(self) -> None:
        """Forgets the last episode."""
        self.copies = None

    def __call__(self, pixels: Any, mission: str, last_action: str | None = None) -> str:
        """What the bot would do, by name. `last_action` is what was done where that was not what it said."""
        seen = frame_of(pixels).rgb
        if self.copies is None:
            seeds = self.known.get((seen, mission), [])
            self.copies = [_Copy(self._make(), seed) for seed in seeds]
        else:
            # Levels that look alike at first part ways later.
            alike = (copy for copy in self.copies if copy.step(last_action) == seen)
            self.copies = list(alike)
        if not self.copies:
            raise CannotDo(f"no level of {self.level} with an expected seed looks like this one ({mission!r})")
        for copy in self.copies[1:]:
            copy.advise()
        return self.copies[0].advise()

    def _make(self) -> MinigridEnvironment:
        environment = make(self.level, self.tile, {})
        if not isinstance(environment, MinigridEnvironment):
            raise CannotDo(f"{self.level} is no level of BabyAI")
        return environment


class _Copy:
    """A level of one seed, with the bot in it."""

    def __init__(self, environment: MinigridEnvironment, seed: int):
        self.environment = environment
        self.names = environment.action_names
        environment.reset(seed, None)
        self.bot = BabyAIBot(environment.level)
        self.advice: str | None = None
        self.taken: str | None = None

    def step(self, action: str | None) -> bytes:
        """Does what was done, or what was advised; what is seen then."""
        self.taken = action or self.advice
        return self.environment.step(self.taken, None).frame.rgb

    def advise(self) -> str:
        taken = None if self.taken is None else self.environment.level.actions[self.taken]
        self.advice = self.names[int(self.bot.replan(taken))]
        return self.advice
