"""AI2-THOR with ALFRED's actions, resets and goals, through the package `ai2thor`."""

from __future__ import annotations

from typing import Any

from ai2thor.controller import Controller
from ai2thor.wsgi_server import WsgiServer

from .alfred_classes import CLASSES
from .alfred_task import AlfredTask, Changes, whole
from .environment import Action, CannotDo, Capabilities, Frame, Observation, Thing
from .thor_candidates import INTERACTIONS, NAVIGATION, candidates, class_of

SIDE = 300
#: ALFRED's settings of the simulator.
SETTINGS: dict[str, Any] = {
    "gridSize": 0.25,
    "cameraY": 0.75,
    "visibilityDistance": 1.5,
    "renderInstanceSegmentation": True,
}
MOVES: dict[str, dict[str, Any]] = {
    "MoveAhead": {"action": "MoveAhead", "moveMagnitude": 0.25, "forceAction": True},
    "RotateLeft": {"action": "RotateLeft", "degrees": 90, "forceAction": True},
    "RotateRight": {"action": "RotateRight", "degrees": 90, "forceAction": True},
    "LookUp": {"action": "LookUp", "degrees": 15, "forceAction": True},
    "LookDown": {"action": "LookDown", "degrees": 15, "forceAction": True},
}
DEEDS: dict[str, dict[str, Any]] = {
    "Pickup": {"action": "PickupObject"},
    "Put": {"action": "PutObject", "forceAction": True, "placeStationary": True},
    "Open": {"action": "OpenObject", "openness": 1.0},
    "Close": {"action": "CloseObject", "forceAction": True},
    "ToggleOn": {"action": "ToggleObjectOn"},
    "ToggleOff": {"action": "ToggleObjectOff"},
    "Slice": {"action": "SliceObject"},
}


def open_controller(scene: str, executable: str | None, player_port: int | None) -> Controller:
    """Starts a player of AI2-THOR, or waits for one at a port."""
    size = {"width": SIDE, "height": SIDE}
    if player_port is not None:
        return Controller(start_unity=False, server_class=WsgiServer, port=player_port, scene=scene, **size)
    return Controller(local_executable_path=executable, scene=scene, **size)


class ThorEnvironment:
    """A simulator with ALFRED's tasks in it; the seed counts through tasks, then through their wordings."""

    def __init__(self, controller: Controller, tasks: list[AlfredTask], steps: int):
        self.controller = controller
        self.tasks = tasks
        self.limit = steps
        self.task = tasks[0]
        self.mission = ""
        self.changes = Changes()
        self.taken = 0
        self.next = 0

    def capabilities(self) -> Capabilities:
        """The 12 actions and 81 classes of ALFRED's agents."""
        moves = [Action(name) for name in NAVIGATION]
        deeds = [Action(name, "class") for name in INTERACTIONS]
        return Capabilities("AI2-THOR", moves + deeds, {"class": list(CLASSES)}, deterministic=None, frame=(SIDE, SIDE))

    def reset(self, seed: int | None, episode: str | None) -> Observation:
        """Sets the scene as ALFRED does."""
        number = self.next if seed is None else seed
        self.next = number + 1
        self.task = self.tasks[number % len(self.tasks)]
        wording = number // len(self.tasks)
        self.mission = self.task.missions[wording % len(self.task.missions)]
        self.changes, self.taken = Changes(), 0
        self.controller.reset(self.task.scene, **SETTINGS)
        if self.task.toggles:
            self._must("SetObjectToggles", objectToggles=self.task.toggles)
        if self.task.dirty_and_empty:
            self._must("SetStateOfAllObjects", StateChange="CanBeDirty", forceAction=True)
            self._must("SetStateOfAllObjects", StateChange="CanBeFilled", forceAction=False)
        self._must("SetObjectPoses", objectPoses=self.task.poses)
        start = dict(self.task.start)
        self._must(start.pop("action"), **start)
        return self._look(None)

    def step(self, action: str, argument: str | None) -> Observation:
        """Acts, on the nearest candidate of a class. Where there is none nothing changes, but the step counts."""
        if action in MOVES:
            self.controller.step(dict(MOVES[action]))
        else:
            possible = candidates(self.controller.last_event.metadata)[action]
            target = next((it for it in possible if class_of(it["objectId"]) == argument), None)
            if target is not None:
                self._interact(action, target)
        self.taken += 1
        return self._look(0.0)

    def snapshot(self) -> Any:
        """The simulator keeps no states."""
        raise CannotDo("AI2-THOR cannot go back to an earlier state; replay from the seed instead")

    def restore(self, state: Any) -> Observation:
        """The simulator keeps no states."""
        raise CannotDo("AI2-THOR cannot go back to an earlier state; replay from the seed instead")

    def close(self) -> None:
        """Ends the simulator."""
        self.controller.stop()

    def _must(self, action: str, **details: Any) -> None:
        self.controller.step(action, raise_for_failure=True, **details)

    def _interact(self, action: str, target: dict[str, Any]) -> None:
        try:
            event = self.controller.step({**DEEDS[action], "objectId": target["objectId"]})
        except ValueError:
            return  # The simulator found it impossible after all.
        if event.metadata["lastActionSuccess"]:
            self._remember(action, target)

    def _remember(self, action: str, target: dict[str, Any]) -> None:
        """Water cleans, microwaves heat and fridges cool: ALFRED keeps account of it beside the simulator."""
        kind = class_of(target["objectId"])
        if action == "ToggleOn" and kind == "Faucet":
            basin = self._nearest_basin(target)
            washed = [] if basin is None else list(basin["receptacleObjectIds"] or [])
            self.changes.cleaned.update(map(whole, washed))
            self.controller.step("Pass")
            for thing in self.controller.last_event.metadata["objects"]:
                if thing["objectId"] in washed and thing.get("isDirty"):
                    self.controller.step("CleanObject", objectId=thing["objectId"])
        elif action == "ToggleOn" and kind == "Microwave":
            self.changes.heated.update(target["receptacleObjectIds"] or [])
        elif action == "Close" and kind == "Fridge":
            self.changes.cooled.update(target["receptacleObjectIds"] or [])

    def _nearest_basin(self, faucet: dict[str, Any]) -> dict[str, Any] | None:
        at = faucet["position"]
        basins = [
            it for it in self.controller.last_event.metadata["objects"] if "SinkBasin" in it["objectId"] and it["visible"]
        ]
        return min(basins, key=lambda it: sum((it["position"][axis] - at[axis]) ** 2 for axis in "xz"), default=None)

    def _look(self, reward: float | None) -> Observation:
        event = self.controller.last_event
        metadata = event.metadata
        held = {it["objectId"] for it in metadata["inventoryObjects"]}
        done = self.task.goal.met(metadata["objects"], held, self.changes)
        possible = candidates(metadata)
        deeds = [list(dict.fromkeys(class_of(it["objectId"]) for it in possible[name])) for name in INTERACTIONS]
        boxes = event.instance_detections2D or {}
        named = [(class_of(name), box) for name, box in boxes.items()]
        height, width = event.frame.shape[:2]
        return Observation(
            frame=Frame(width, height, event.frame[:, :, :3].tobytes()),
            mission=self.mission,
            legal=[True] * len(NAVIGATION) + deeds,
            success=done,
            terminated=done,
            truncated=not done and self.taken >= self.limit,
            things=[
                Thing(name, (int(left), int(top), int(right) + 1, int(bottom) + 1))
                for name, (left, top, right, bottom) in named
                if name is not None
            ],
            reward=None if reward is None else float(done),
        )
