"""A player in Unity's place: it speaks with `ai2thor`'s controller as Unity does, and plays a small kitchen by simple rules."""

from __future__ import annotations

import json
import threading
import time
import urllib.error
import urllib.request
from typing import Any

SIDE = 300
BOUNDARY = "player"
TRIES, BETWEEN_TRIES = 600, 0.05
SINK, FAUCET, FRIDGE, MICROWAVE = "Sink|0|1|1|SinkBasin", "Faucet|0|1|1", "Fridge|1|0|0", "Microwave|0|1|-1"
MUG, KNIFE, TABLE, BREAD = "Mug|0.2|1|0.8", "Knife|0.3|1|0.5", "CounterTop|0|1|0.5", "Bread|0.4|1|0.4"
FAR = "Apple|9|1|9"
ANSWERS = {
    "GetScenesInBuild": ["FloorPlan1_physics"],
    "Initialize": {"cameraNearPlane": 0.1, "cameraFarPlane": 20.0},
}


def thing(name: str, **facts: Any) -> dict[str, Any]:
    """A thing as the simulator's metadata tells it; its position is in its name."""
    x, y, z = map(float, name.split("|")[1:4])
    kinds = ["pickupable", "receptacle", "openable", "isOpen", "toggleable", "isToggled", "sliceable", "isSliced"]
    told: dict[str, Any] = dict.fromkeys([*kinds, "isPickedUp", "isDirty"], False)
    told |= {"objectId": name, "objectType": name.split("|")[0], "visible": True, "receptacleObjectIds": None}
    return told | {"position": {"x": x, "y": y, "z": z}} | facts


class Kitchen:
    """The state of the kitchen, and what was asked of it."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.begin()

    def begin(self) -> None:
        self.things = {
            it["objectId"]: it
            for it in [
                thing(SINK, receptacle=True, receptacleObjectIds=[]),
                thing(FAUCET, toggleable=True),
                thing(FRIDGE, receptacle=True, openable=True, receptacleObjectIds=[]),
                thing(MICROWAVE, receptacle=True, openable=True, toggleable=True, receptacleObjectIds=[]),
                thing(TABLE, receptacle=True, receptacleObjectIds=[MUG, KNIFE, BREAD]),
                thing(MUG, pickupable=True, isDirty=True),
                thing(KNIFE, pickupable=True),
                thing(BREAD, pickupable=True, sliceable=True),
                thing(FAR, pickupable=True),
            ]
        }
        self.held: str | None = None
        self.position = {"x": 0.0, "y": 1.0, "z": 0.0}
        self.rotation = 0.0

    def act(self, action: dict[str, Any]) -> bool:
        """Whether an action was possible."""
        self.asked.append(action)
        target = self.things.get(action.get("objectId", ""))
        match action["action"]:
            case "Reset":
                self.begin()
            case "TeleportFull":
                self.position = {axis: action[axis] for axis in "xyz"}
                self.rotation = float(action["rotation"]["y"])
            case "RotateLeft" | "RotateRight":
                turn = action["degrees"] if action["action"] == "RotateRight" else -action["degrees"]
                self.rotation = (self.rotation + turn) % 360
            case "PickupObject":
                self._leave(action["objectId"])
                self.held, target["isPickedUp"] = action["objectId"], True
            case "PutObject":
                target["receptacleObjectIds"].append(self.held)
                self.things[self.held]["isPickedUp"] = False
                self.held = None
            case "OpenObject" | "CloseObject":
                target["isOpen"] = action["action"] == "OpenObject"
            case "ToggleObjectOn" | "ToggleObjectOff":
                if target["isOpen"]:
                    return False
                target["isToggled"] = action["action"] == "ToggleObjectOn"
            case "SliceObject":
                target["isSliced"] = True
            case "CleanObject":
                target["isDirty"] = False
        return True

    def _leave(self, name: str) -> None:
        for place in self.things.values():
            if name in (place["receptacleObjectIds"] or []):
                place["receptacleObjectIds"].remove(name)

    def metadata(self, last: str, success: bool) -> dict[str, Any]:
        mug = {"name": MUG, "color": [10, 20, 30]}
        return {
            "screenWidth": SIDE,
            "screenHeight": SIDE,
            "sceneName": "FloorPlan1",
            "agent": {"position": self.position, "rotation": {"x": 0, "y": self.rotation, "z": 0}, "cameraHorizon": 30},
            "objects": list(self.things.values()),
            "inventoryObjects": [{"objectId": self.held}] if self.held else [],
            "colors": [mug],
            "lastAction": last,
            "lastActionSuccess": success,
            "errorMessage": "" if success else "it is open",
            "errorCode": "" if success else "ObjectNotInteractable",
            "actionReturn": ANSWERS.get(last),
            "thirdPartyCameras": [],
        }


class StandInPlayer:
    """Connects to a controller that waits at a port, and obeys it until it is told to end."""

    def __init__(self, port: int):
        self.kitchen = Kitchen()
        self.url = f"http://127.0.0.1:{port}/train"
        self.thread = threading.Thread(target=self._play, daemon=True)
        self.thread.start()

    def _play(self) -> None:
        last, success, sequence = "Initialize", True, 0
        while True:
            told = {"sequenceId": sequence, "activeAgentId": 0, "agents": [self.kitchen.metadata(last, success)]}
            action = self._send(json.dumps(told))
            if not action.get("action"):
                return
            last, sequence = action["action"], action["sequenceId"]
            success = self.kitchen.act(action)

    def _send(self, metadata: str) -> dict[str, Any]:
        frame = bytes([int(self.kitchen.rotation) % 256, 0, 0]) * (SIDE * SIDE)
        masks = bytearray(bytes([0, 0, 0, 255]) * (SIDE * SIDE))
        for row in range(100, 120):  # Rows come from below: the mug fills 180 to 199, columns 30 to 59.
            masks[4 * (row * SIDE + 30) : 4 * (row * SIDE + 60)] = bytes([10, 20, 30, 255]) * 30
        parts = [("metadata", None, metadata.encode()), ("token", None, b"")]
        parts += [("image", "image", frame), ("image_ids", "image_ids", bytes(masks))]
        body = b"".join(self._part(*part) for part in parts) + f"\r\n--{BOUNDARY}--\r\n".encode()
        head = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"}
        for _ in range(TRIES):
            try:
                with urllib.request.urlopen(urllib.request.Request(self.url, body, head), timeout=60) as answer:
                    return json.load(answer)
            except urllib.error.URLError as problem:
                if not isinstance(problem.reason, ConnectionRefusedError):
                    raise
                time.sleep(BETWEEN_TRIES)  # The controller does not listen yet.
        raise TimeoutError(self.url)

    @staticmethod
    def _part(name: str, file: str | None, content: bytes) -> bytes:
        kind = "text/plain; charset=utf-8" if file is None else "application/octet-stream"
        of = "" if file is None else f'; filename="{file}"'
        head = f'\r\n--{BOUNDARY}\r\nContent-Type: {kind}\r\nContent-disposition: form-data; name="{name}"{of}\r\n\r\n'
        return head.encode() + content
