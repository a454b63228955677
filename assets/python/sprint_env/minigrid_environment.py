"""Minigrid and BabyAI: the agent's own view, missions and their parts, things in view, and states to go back to."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium
import numpy
from minigrid.core.grid import Grid
from minigrid.envs.babyai.core.verifier import SeqInstr
from minigrid.minigrid_env import MiniGridEnv

from .environment import Capabilities, Observation, Subtask, Thing
from .gym_environment import GymEnvironment, frame_of

#: What stands everywhere and tells nothing.
BACKGROUND = ("wall", "floor")


class RememberedView:
    """Stands in a level's own place for working out the agent's view, which is half of a step's time, and keeps it for drawing.

    A copy of the level has a copy of this, which belongs to it.
    """

    def __init__(self, level: MiniGridEnv):
        self.level = level
        self.cells: tuple[Any, Any] | None = None

    def __call__(self, agent_view_size: int | None = None) -> tuple[Any, Any]:
        """The cells before the agent, and which of them it sees."""
        self.cells = type(self.level).gen_obs_grid(self.level, agent_view_size)
        return self.cells


class MinigridEnvironment(GymEnvironment):
    """A level of Minigrid, seen by its agent: what lies before it, drawn with tiles of so many pixels."""

    def __init__(self, env: gymnasium.Env, name: str, tile: int = 8):
        super().__init__(env, name)
        self.level.gen_obs_grid = RememberedView(self.level)
        self.tile = tile
        self.is_seen = self.is_rendered = False
        self.solved: bool | None = None
        self.parts: list[tuple[str, SeqInstr | None, str]] = []

    @property
    def level(self) -> MiniGridEnv:
        """Minigrid's own environment under Gymnasium's wrappers."""
        return self.env.unwrapped

    def capabilities(self) -> Capabilities:
        """All of the agent's view is drawn, so its size is known beforehand."""
        side = self.level.agent_view_size * self.tile
        told = super().capabilities()
        return Capabilities(told.name, told.actions, snapshot=True, deterministic=True, frame=(side, side))

    def reset(self, seed: int | None, episode: str | None) -> Observation:
        """Begins a level; its mission may have several parts."""
        seen, _ = self.env.reset(seed=seed)
        self.solved = None
        instruction = getattr(self.level, "instrs", None)
        self.parts = _parts(instruction, self.level) if instruction is not None else []
        return self._look(seen, Observation())

    def step(self, action: str, argument: str | None) -> Observation:
        """Acts. A level that ends with a reward is solved, one that ends without is lost."""
        seen, reward, terminated, truncated, _ = self.env.step(self.action_names.index(action))
        if terminated or truncated:
            self.solved = bool(terminated and reward > 0)
        over = Observation(terminated=bool(terminated), truncated=bool(truncated), reward=float(reward))
        return self._look(seen, over)

    def snapshot(self) -> Any:
        """A copy of the whole level, its chance included."""
        return copy.deepcopy((self.env, self.parts, self.solved))

    def restore(self, state: Any) -> Observation:
        """Goes on in a copy, so that the state can be gone back to again."""
        self.env, self.parts, self.solved = copy.deepcopy(state)
        return self._look(self.level.gen_obs(), Observation())

    def _look(self, seen: dict[str, Any], over: Observation) -> Observation:
        grid, visible = self.level.gen_obs_grid.cells
        over.frame = frame_of(_draw(grid, visible, self.tile))
        over.things = [
            self._thing(cell, x, y)
            for y in range(grid.height)
            for x in range(grid.width)
            if visible[x, y] and (cell := grid.get(x, y)) is not None and cell.type not in BACKGROUND
        ]
        over.mission = seen["mission"]
        over.success = self.solved
        done = bool(self.solved)
        over.subtasks = [
            Subtask(text, done or (whole is not None and getattr(whole, which) == "success"))
            for text, whole, which in self.parts
        ]
        if not over.subtasks:
            over.subtasks = [Subtask(over.mission, done)]
        return over

    def _thing(self, cell: Any, x: int, y: int) -> Thing:
        name = f"{cell.color} {cell.type}"
        return Thing(name, (x * self.tile, y * self.tile, (x + 1) * self.tile, (y + 1) * self.tile))


def _draw(grid: Grid, visible: numpy.ndarray, tile: int) -> numpy.ndarray:
    """The agent's view as Minigrid draws it. Its `Grid.render` compares arrays in each cell to find the agent."""
    picture = numpy.empty((grid.height, tile, grid.width, tile, 3), numpy.uint8)
    agent = (grid.width // 2, grid.height - 1)
    for y in range(grid.height):
        for x in range(grid.width):
            facing = 3 if (x, y) == agent else None
            picture[y, :, x] = Grid.render_tile(grid.get(x, y), facing, visible[x, y], tile)
    return picture.reshape(grid.height * tile, grid.width * tile, 3)


def _parts(instruction: Any, level: MiniGridEnv, whole: SeqInstr | None = None, which: str = "") -> list:
    """The single things that a mission asks for, each with the instruction that follows whether it is done."""
    if not isinstance(instruction, SeqInstr):
        return [(instruction.surface(level), whole, which)]
    # A part of two parts is done with the later of them; each of those is followed by itself.
    first = _parts(instruction.instr_a, level, instruction, "a_done")
    second = _parts(instruction.instr_b, level, instruction, "b_done")
    return second + first if type(instruction).__name__ == "AfterInstr" else first + second
