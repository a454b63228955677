"""The local socket of `sprint serve`: steps and observations as bytes. Nothing but the standard library."""

from __future__ import annotations

import json
import socket
import struct
from dataclasses import dataclass, field
from typing import Any

JSON, STEP = 0, 1
LENGTH = struct.Struct("<I")
#: Reward, steps, width, height, subtasks done and of how many, flags, length of the words.
HEADER = struct.Struct("<fIHHHHII")
SUCCESS, TIMEOUT, POSSIBLE, LEGAL = 1, 2, 4, 8
#: Entries of the table of what is possible: 12 actions by 82 classes.
ACTIONS, CLASSES = 12, 82


class HouseError(RuntimeError):
    """What the server refused, in its words."""


@dataclass
class HouseObservation:
    """A state of House. Frame and table are views of one buffer, which no later observation changes."""

    reward: float
    steps: int
    size: tuple[int, int]
    completed: int
    subtasks: int
    flags: int
    frame: memoryview
    legal: memoryview | None
    #: What is asked: `task`, `mission` and `subtasks`; after a reset or a restore.
    words: dict[str, Any] = field(default_factory=dict)

    @property
    def success(self) -> bool:
        """Every subtask is done."""
        return bool(self.flags & SUCCESS)

    @property
    def timeout(self) -> bool:
        """The task's time is over."""
        return bool(self.flags & TIMEOUT)

    @property
    def possible(self) -> bool:
        """The last action was possible."""
        return bool(self.flags & POSSIBLE)


class HouseClient:
    """A connection to House: one episode at a time."""

    def __init__(self, path: str):
        self.connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.connection.connect(path)
        self.length = bytearray(LENGTH.size)

    def reset(self, seed: int | None, **options: Any) -> HouseObservation:
        """Begins the episode of a seed. Options: `size` of frames in pixels, whether `legal` is told, `episode` by name."""
        return self._observed({"type": "reset", "data": {"seed": seed, **options}})

    def step(self, action: int, kind: int) -> HouseObservation:
        """Takes an action by its place, on the nearest thing of a class by its place."""
        self.connection.sendall(struct.pack("<IBBB", 3, STEP, action, kind))
        return self._observation()

    def snapshot(self) -> str:
        """Keeps the present state; its name."""
        return self.ask("snapshot")["id"]

    def restore(self, name: str) -> HouseObservation:
        """Goes back to a state that was kept."""
        return self._observed({"type": "restore", "data": {"id": name}})

    def ask(self, kind: str, **data: Any) -> dict[str, Any]:
        """The data of the answer to one of OpenEnv's messages."""
        self._send({"type": kind, "data": data})
        answer = self._receive()
        return self._read(answer)["data"]

    def close(self) -> None:
        """Leaves."""
        self.connection.close()

    def _observed(self, message: dict[str, Any]) -> HouseObservation:
        self._send(message)
        return self._observation()

    def _send(self, message: dict[str, Any]) -> None:
        text = json.dumps(message).encode()
        self.connection.sendall(LENGTH.pack(len(text) + 1) + bytes([JSON]) + text)

    def _receive(self) -> memoryview:
        self._fill(memoryview(self.length))
        (length,) = LENGTH.unpack(self.length)
        # A new buffer for each message: whoever keeps an observation keeps its own.
        message = memoryview(bytearray(length))
        self._fill(message)
        return message

    def _fill(self, part: memoryview) -> None:
        while part:
            read = self.connection.recv_into(part)
            if read == 0:
                raise ConnectionError("sprint serve has ended the connection")
            part = part[read:]

    def _read(self, message: memoryview) -> dict[str, Any]:
        answer = json.loads(bytes(message[1:]))
        if answer["type"] == "error":
            raise HouseError(answer["data"]["message"])
        return answer

    def _observation(self) -> HouseObservation:
        message = self._receive()
        if message[0] != STEP:
            raise HouseError(f"no observation came: {self._read(message)}")
        reward, steps, width, height, completed, of, flags, words = HEADER.unpack_from(message, 1)
        at = 1 + HEADER.size
        told = json.loads(bytes(message[at : at + words])) if words else {}
        at += words
        legal = None
        if flags & LEGAL:
            legal = message[at : at + ACTIONS * CLASSES]
            at += ACTIONS * CLASSES
        return HouseObservation(reward, steps, (width, height), completed, of, flags, message[at:], legal, told)
