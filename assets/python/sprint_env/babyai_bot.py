"""BabyAI's own bot behind `--policy ws:HOST:PORT`, for environments `gym:BabyAI-...`:

    python -m sprint_env.babyai_bot --port 8000

The bot plans on the level itself, which no picture shows whole, so it plays in a copy of its own: that of the seed by which the
environment was reset. What was done since then it gives along with every answer, so that it finds its way wherever an explorer
goes back to.
"""

from __future__ import annotations

import argparse
from typing import Any

from minigrid.utils.baby_ai_bot import BabyAIBot

from .environment import CannotDo
from .make_gym import make
from .minigrid_environment import MinigridEnvironment

#: How `--env` names environments of Gymnasium.
GYM = "gym:"


class BabyAIBotPolicy:
    """The bot, told of episodes and observations as a policy server is."""

    def __init__(self) -> None:
        self.level: MinigridEnvironment | None = None
        self.name = ""
        self.seed: int | None = None
        self.copy: _Copy | None = None

    def begin(self, episode: dict[str, Any]) -> None:
        """An episode begins in the level of that name and seed."""
        name, self.seed = episode["task"]["environment"], episode["task"].get("environment_seed")
        if not name.startswith(f"{GYM}BabyAI-"):
            raise CannotDo(f"{name} is no level of BabyAI, such as {GYM}BabyAI-GoToLocal-v0")
        if name != self.name:
            level = make(name.removeprefix(GYM), 8, {})
            if not isinstance(level, MinigridEnvironment):
                raise CannotDo(f"{name} is no level of BabyAI")
            self.name, self.level = name, level
        self.copy = None

    def act(self, observation: dict[str, Any]) -> dict[str, Any]:
        """What the bot would do, and what was done before."""
        if self.seed is None or self.level is None:
            raise CannotDo("the bot has to be told the seed of the level")
        done = list(observation["state"] or [])
        # Asked twice at one step it has been told of the last action already.
        if observation["step"] > len(done):
            done.append(observation["last_action"])
        if len(done) != observation["step"] or None in done:
            raise CannotDo("the bot has to see an episode from its start")
        if self.copy is None or self.copy.done not in (done, done[:-1]):
            self.copy = _Copy(self.level, self.seed)
        for action in done[len(self.copy.done) :]:
            self.copy.step(action)
        return {"action": self.copy.advice, "state": done}


class _Copy:
    """A level of one seed, with the bot in it."""

    def __init__(self, level: MinigridEnvironment, seed: int):
        self.environment = level
        level.reset(seed, None)
        self.bot = BabyAIBot(level.level)
        self.done: list[str] = []
        self.advice = self._advise(None)

    def step(self, action: str) -> None:
        """Does what was done, and asks the bot what it would do then."""
        self.environment.step(action, None)
        self.done.append(action)
        self.advice = self._advise(action)

    def _advise(self, taken: str | None) -> str:
        action = None if taken is None else self.environment.level.actions[taken]
        return self.environment.action_names[int(self.bot.replan(action))]


if __name__ == "__main__":
    from .policy_server import serve

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--port", type=int, default=8000)
    serve(BabyAIBotPolicy, parser.parse_args().port, "babyai-bot")
