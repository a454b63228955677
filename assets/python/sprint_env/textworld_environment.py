"""TextWorld: games that are read, not seen. A command is any text; what the game understands now is told."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import textworld

from .environment import Action, CannotDo, Capabilities, Observation, Subtask

#: The only action; what is said is its argument.
SAY = "command"
WANTED = textworld.EnvInfos(
    feedback=True,
    description=True,
    objective=True,
    admissible_commands=True,
    won=True,
    lost=True,
    score=True,
)


@dataclass(frozen=True)
class GameSize:
    """How large a generated game is."""

    rooms: int = 3
    objects: int = 6
    quest: int = 3


class Games:
    """Game files: given ones in turn, or one that is generated for each seed and kept while this lives."""

    def __init__(self, files: Sequence[str], size: GameSize):
        for file in files:
            if not Path(file).is_file():
                raise CannotDo(f"{file}: there is no such game; tw-make makes some")
        self.files = list(files)
        self.size = size
        self.folder = None if files else tempfile.TemporaryDirectory(prefix="sprint-textworld-")

    @property
    def name(self) -> str:
        """What they are called."""
        if self.folder is None:
            return Path(self.files[0]).stem if len(self.files) == 1 else f"TextWorld ({len(self.files)} games)"
        return f"TextWorld-{self.size.rooms}-{self.size.objects}-{self.size.quest}"

    def file(self, seed: int) -> str:
        """The game of a seed."""
        if self.folder is None:
            return self.files[seed % len(self.files)]
        path = Path(self.folder.name) / f"{seed}.z8"
        if not path.exists():
            options = textworld.GameOptions()
            options.nb_rooms, options.nb_objects = self.size.rooms, self.size.objects
            options.quest_length = self.size.quest
            options.seeds = seed
            options.path = str(path)
            textworld.make(options)
        return str(path)


class TextWorldEnvironment:
    """Games of TextWorld, each with an objective."""

    def __init__(self, games: Games, steps: int):
        self.games = games
        self.limit = steps
        self.game: Any = None
        self.score = 0.0
        self.taken = 0
        self.next = 0

    def capabilities(self) -> Capabilities:
        """One action, whose argument is any text."""
        return Capabilities(
            name=self.games.name,
            actions=[Action(SAY, SAY)],
            arguments={SAY: None},
            snapshot=True,
            deterministic=True,
        )

    def reset(self, seed: int | None, episode: str | None) -> Observation:
        """Begins the game of a seed, else the one after the last."""
        number = self.next if seed is None else seed
        self.next = number + 1
        file = self.games.file(number)
        self.close()
        self.game = textworld.start(file, WANTED)
        state = self.game.reset()
        self.score, self.taken = 0.0, 0
        # The game's own first words are a banner, then the objective, then this.
        return self._read(state, state.description, None)

    def step(self, action: str, argument: str | None) -> Observation:
        """Says a command. What the game does not understand takes a step too."""
        state, score, _ = self.game.step(argument)
        self.taken += 1
        reward, self.score = float(score - self.score), float(score)
        return self._read(state, state.feedback, reward)

    def snapshot(self) -> Any:
        """A copy of the game as it stands."""
        return self.game.copy(), self.score, self.taken

    def restore(self, state: Any) -> Observation:
        """Goes on in a copy, so that the state can be gone back to again."""
        game, self.score, self.taken = state
        self.game = game.copy()
        return self._read(self.game.state, self.game.state.feedback, None)

    def close(self) -> None:
        """Ends the game under way."""
        if self.game is not None:
            self.game.close()
            self.game = None

    def _read(self, state: Any, text: str, reward: float | None) -> Observation:
        progress = state["_game_progression"].quest_progressions
        is_over = bool(state.won or state.lost)
        return Observation(
            text=text.strip(),
            mission=state.objective,
            legal=[list(state.admissible_commands)],
            success=bool(state.won) if is_over or self.taken >= self.limit else None,
            terminated=is_over,
            truncated=not is_over and self.taken >= self.limit,
            subtasks=[Subtask(part.quest.desc or state.objective, bool(part.completed)) for part in progress],
            reward=reward,
        )
