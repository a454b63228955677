"""Plays an episode of House over both of its protocols, with nothing but the standard library.

`python3 serve_client.py URL SOCKET`: prints what came of it as a JSON object.
"""

import base64
import hashlib
import json
import os
import random
import socket
import struct
import sys
import urllib.parse
import urllib.request

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "assets", "python"))

from sprint_env.house_client import HouseClient  # noqa: E402

SEED = 3


class WebSocket:
    """Just enough of RFC 6455: texts in one frame."""

    def __init__(self, url: str):
        parts = urllib.parse.urlsplit(url)
        self.connection = socket.create_connection((parts.hostname, parts.port))
        key = base64.b64encode(bytes(16)).decode()
        self.connection.sendall(
            f"GET {parts.path} HTTP/1.1\r\nHost: {parts.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        self.stream = self.connection.makefile("rb")
        lines = iter(self.stream.readline, b"\r\n")
        head = [line.strip().decode().lower() for line in lines]
        proof = hashlib.sha1((key + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11").encode()).digest()
        assert head[0].split()[1] == "101", head
        assert f"sec-websocket-accept: {base64.b64encode(proof).decode().lower()}" in head, head

    def ask(self, kind: str, **data: object) -> dict:
        text = json.dumps({"type": kind, "data": data}).encode()
        size = bytes([0x80 | len(text)]) if len(text) < 126 else b"\xfe" + struct.pack(">H", len(text))
        self.connection.sendall(b"\x81" + size + bytes(4) + text)  # Masked by zeros.
        first, length = self.stream.read(2)
        assert first == 0x81, first
        if length == 126:
            (length,) = struct.unpack(">H", self.stream.read(2))
        elif length == 127:
            (length,) = struct.unpack(">Q", self.stream.read(8))
        return json.loads(self.stream.read(length))


def main() -> None:
    url, path = sys.argv[1:]
    web, local = WebSocket(url), HouseClient(path)
    with urllib.request.urlopen(url.replace("ws:", "http:").removesuffix("/ws") + "/health", timeout=30) as page:
        health = json.load(page)["status"]
    told = web.ask("capabilities")["data"]
    actions = [action["name"] for action in told["actions"]]
    classes = ["None", *told["arguments"]["class"]]
    chance = random.Random(0)
    seen = web.ask("reset", seed=SEED)["data"]
    beside = local.reset(SEED)
    mission = seen["observation"]["mission"]
    assert mission == beside.words["mission"], (mission, beside.words)
    steps, interactions = 0, 0
    while not seen["done"]:
        legal = seen["observation"]["legal"]
        assert bytes(beside.legal) == table(legal, classes)
        assert base64.b64decode(seen["observation"]["frame"]["data"]) == bytes(beside.frame)
        possible = [(name, entry) for name, entry in zip(actions, legal) if entry]
        name, entry = chance.choice(possible)
        argument = None if entry is True else chance.choice(entry)
        interactions += argument is not None
        seen = web.ask("step", action=name, argument=argument)["data"]
        beside = local.step(actions.index(name), classes.index(argument or "None"))
        assert seen["metadata"]["outcome"] == "ok" or argument is None, seen["metadata"]
        assert seen["reward"] == beside.reward
        steps += 1
    over = (seen["observation"]["success"], seen["observation"]["truncated"])
    assert over == (beside.success, beside.timeout)
    print(json.dumps({"health": health, "mission": mission, "steps": steps, "interactions": interactions, "over": over}))


def table(legal: list, classes: list[str]) -> bytes:
    """What is possible, as the local protocol tells it."""
    cells = bytearray(len(legal) * len(classes))
    for row, entry in enumerate(legal):
        for name in ["None"] if entry is True else entry:
            cells[row * len(classes) + classes.index(name)] = 1
    return bytes(cells)


if __name__ == "__main__":
    main()
