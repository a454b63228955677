"""House as an environment of Gymnasium."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy

from .house_client import ACTIONS, CLASSES, HouseClient, HouseObservation
from .house_server import HouseServer

#: The first actions take no class.
NAVIGATION = 5
LONGEST_MISSION = 500
#: What a mission may be made of; anything else is told as a question mark.
CHARACTERS = "".join(map(chr, [*range(0x20, 0x7F), *range(0xA0, 0x180)]))


class HouseEnv(gymnasium.Env):
    """Household tasks described in words.

    An action is the place of one of 12 low-level actions and that of an object class (0 for the five that move the agent): the
    nearest thing of that class is acted on. An action that is impossible changes nothing but takes a step. The reward is 1 for
    each subtask that is completed; an episode terminates with the last of them, and is truncated at the task's horizon.

    `options` are those of `sprint serve`, and say where episodes come from. Without `server` the program is started for this
    environment alone and ended with it; environments that share one give a `HouseServer`, or its `socket`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        options: Sequence[str] = (),
        size: int = 128,
        legal: bool = False,
        server: HouseServer | str | None = None,
        render_mode: str | None = None,
    ):
        self.size = size
        #: Whether `info` has the table of what is possible, which costs a look around at each step.
        self.legal = legal
        self.render_mode = render_mode
        self.action_space = gymnasium.spaces.MultiDiscrete([ACTIONS, CLASSES])
        self.observation_space = gymnasium.spaces.Dict(
            frame=gymnasium.spaces.Box(0, 255, (size, size, 3), numpy.uint8),
            mission=gymnasium.spaces.Text(LONGEST_MISSION, charset=CHARACTERS, min_length=0),
        )
        self._own = HouseServer(options) if server is None else None
        shared = server.socket if isinstance(server, HouseServer) else server
        self.client = HouseClient(self._own.socket if self._own else shared)
        told = self.client.ask("capabilities")
        self.action_names: list[str] = [action["name"] for action in told["actions"]]
        self.class_names: list[str] = ["None", *told["arguments"]["class"]]
        self.mission = ""
        self.subtasks: list[str] = []
        self.frame: numpy.ndarray | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begins the episode of a seed, else of one that is drawn. `options={"episode": NAME}` picks a task of a file."""
        super().reset(seed=seed)
        number = int(self.np_random.integers(2**31)) if seed is None else seed
        name = (options or {}).get("episode")
        return self._begun(self.client.reset(number, size=self.size, legal=self.legal, episode=name))

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Acts."""
        kind, of = int(action[0]), int(action[1])
        seen = self.client.step(kind, of if kind >= NAVIGATION else 0)
        return self._look(seen), seen.reward, seen.success, seen.timeout, self._info(seen)

    def snapshot(self) -> str:
        """Keeps the present state; its name for `restore`."""
        return self.client.snapshot()

    def restore(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        """Goes back to a state of `snapshot`, of another episode too."""
        return self._begun(self.client.restore(name))

    def action(self, name: str, kind: str = "None") -> numpy.ndarray:
        """An action by its name, and that of a class."""
        return numpy.array([self.action_names.index(name), self.class_names.index(kind)])

    def render(self) -> numpy.ndarray | None:
        """The present frame."""
        return self.frame

    def close(self) -> None:
        """Leaves, and ends the program that was started for this environment."""
        self.client.close()
        if self._own is not None:
            self._own.close()

    def _begun(self, seen: HouseObservation) -> tuple[dict[str, Any], dict[str, Any]]:
        told = seen.words["mission"][:LONGEST_MISSION]
        self.mission = "".join(letter if letter in CHARACTERS else "?" for letter in told)
        self.subtasks = seen.words["subtasks"]
        return self._look(seen), {**self._info(seen), "task": seen.words["task"], "subtasks": self.subtasks}

    def _look(self, seen: HouseObservation) -> dict[str, Any]:
        width, height = seen.size
        self.frame = numpy.frombuffer(seen.frame, numpy.uint8).reshape(height, width, 3)
        return {"frame": self.frame, "mission": self.mission}

    def _info(self, seen: HouseObservation) -> dict[str, Any]:
        info: dict[str, Any] = {
            "completed": seen.completed,
            "of": seen.subtasks,
            "possible": seen.possible,
            "is_success": seen.success,
        }
        if seen.legal is not None:
            info["legal"] = numpy.frombuffer(seen.legal, numpy.bool_).reshape(ACTIONS, CLASSES)
        return info


gymnasium.register("sprint/House-v0", entry_point="sprint_env.house_env:HouseEnv")
