"""`sprint serve` as a child of this process."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
import weakref
from collections.abc import Sequence
from typing import IO

#: How long the program may take to end, in seconds.
ENDING_TIME = 10.0


class HouseServer:
    """House in a process of its own, for as many `HouseEnv` as connect to its `socket`.

    `options` are those of `sprint serve`, for instance `["--rooms", "kitchen,bathroom", "--length", "1"]`. The program is found
    by `program`, by the environment variable `SPRINT`, or on the PATH.
    """

    def __init__(self, options: Sequence[str] = (), program: str | None = None):
        found = program or os.environ.get("SPRINT") or shutil.which("sprint")
        if found is None:
            raise FileNotFoundError("the program sprint is not on the PATH; name it in the environment variable SPRINT")
        # What it says is kept, so that a failure can be explained.
        said = tempfile.TemporaryFile()
        command = [found, "serve", *options]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said)
        self._finalizer = weakref.finalize(self, _end, self.process, said)
        line = self.process.stdout.readline()
        if not line:
            self.process.wait(ENDING_TIME)
            words = _last_words(said)
            self.close()
            raise RuntimeError(f"{' '.join(command)} ended: {words}")
        start = json.loads(line)
        self.socket: str = start["socket"]
        self.url: str = start["url"]

    def close(self) -> None:
        """Ends the program, and waits until it has."""
        self._finalizer()

    def __enter__(self) -> HouseServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _end(process: subprocess.Popen, said: IO[bytes]) -> None:
    process.stdin.close()
    try:
        process.wait(ENDING_TIME)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()
    said.close()


def _last_words(said: IO[bytes]) -> str:
    said.seek(0)
    return said.read().decode(errors="replace").strip()[-2000:] or "it said nothing"
