"""A server as the program starts it, and a client that speaks with it."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

PACKAGE = Path(__file__).resolve().parents[1]


class Served:
    """`python -m sprint_env ARGUMENTS` with a connection to it, both ended on leaving."""

    def __init__(self, *arguments: str):
        command = [sys.executable, "-m", "sprint_env", *arguments]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        self.process = subprocess.Popen(command, cwd=PACKAGE, text=True, **pipes)
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(self.process.communicate()[1])
        self.start = json.loads(line)
        self.connections = ExitStack()
        self.socket = self.connect()

    def connect(self) -> ClientConnection:
        return self.connections.enter_context(connect(self.start["url"], compression=None))

    def ask(self, kind: str, **data: object) -> dict[str, Any]:
        self.socket.send(json.dumps({"type": kind, "data": data}))
        return json.loads(self.socket.recv(timeout=60))

    def see(self, kind: str, **data: object) -> dict[str, Any]:
        """The observation that answers a request."""
        answer = self.ask(kind, **data)
        if answer["type"] != "observation":
            raise AssertionError(answer)
        return answer["data"]

    def __enter__(self) -> Served:
        return self

    def __exit__(self, *_: object) -> None:
        self.connections.close()
        self.process.stdin.close()
        self.process.wait(10)
        self.process.stdout.close()
        self.process.stderr.close()
