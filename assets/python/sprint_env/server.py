"""Serves environments over WebSockets as OpenEnv does: a thread and an environment of its own for each connection."""

from __future__ import annotations

import http
import json
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from typing import TextIO

from websockets.frames import Opcode
from websockets.http11 import Request
from websockets.protocol import State
from websockets.server import ServerProtocol

from .environment import Environment
from .schemas import schemas
from .session import Session, error

#: The largest message that is taken, as OpenEnv's client has it.
MESSAGE_BYTES = 100 * 1024 * 1024
#: How many connections may play at a time.
SESSIONS = 64
#: How long environments may take to close when the server ends, in seconds.
CLOSING_TIME = 5.0


class Server:
    """Listens from the moment it is made; `serve` takes connections."""

    def __init__(self, make: Callable[[], Environment], first: Environment, host: str, port: int):
        self.make = make
        self.capabilities = first.capabilities()
        #: For whoever connects first.
        self.spare = [first]
        self.listener = socket.create_server((host, port))
        self.environments: set[Environment] = set()
        self.lock = threading.Lock()
        address = self.listener.getsockname()
        self.url = f"ws://{address[0]}:{address[1]}/ws"

    def serve(self) -> None:
        """Takes connections until the listener closes."""
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self._connected, args=(connection,), daemon=True).start()

    def close(self) -> None:
        """Takes no more connections, and closes every environment."""
        self.listener.close()
        with self.lock:
            environments = [*self.environments, *self.spare]
            self.spare.clear()
        for environment in environments:
            environment.close()

    def _connected(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        wire = Wire(connection, self._page)
        with connection:
            try:
                self._converse(wire)
            except OSError:
                pass  # Whoever was connected is gone.

    def _converse(self, wire: Wire) -> None:
        messages = wire.messages()
        for _ in messages:  # The handshake.
            break
        else:
            return
        with self.lock:
            is_full = len(self.environments) >= SESSIONS
            spare = self.spare.pop() if self.spare else None
        if is_full:
            wire.send(error(f"{SESSIONS} sessions are open already", "CAPACITY_REACHED"))
            return wire.close()
        try:
            environment = spare or self.make()
        except Exception as problem:
            wire.send(error(f"{type(problem).__name__}: {problem}", "FACTORY_ERROR"))
            return wire.close()
        with self.lock:
            self.environments.add(environment)
        try:
            session = Session(environment)
            for message in messages:
                answer = session.answer(message)
                if answer is None:
                    return wire.close()
                wire.send(answer)
        finally:
            with self.lock:
                self.environments.discard(environment)
            environment.close()

    def _page(self, path: str) -> str | None:
        match path:
            case "/health":
                return json.dumps({"status": "healthy"})
            case "/schema":
                return json.dumps(schemas(self.capabilities))
            case "/metadata":
                name = self.capabilities.name
                return json.dumps({"name": name, "description": f"{name}, served by sprint_env"})
            case _:
                return None


class Wire:
    """A connection: the package `websockets` knows the protocol, this moves the bytes, without a thread in between."""

    def __init__(self, connection: socket.socket, page: Callable[[str], str | None]):
        self.connection = connection
        self.page = page
        self.protocol = ServerProtocol(max_size=MESSAGE_BYTES)

    def messages(self) -> Iterator[bytes]:
        """First an empty one when the handshake is done, then each message that comes in."""
        parts: list[bytes] = []
        while True:
            data = self.connection.recv(1 << 16)
            if data:
                self.protocol.receive_data(data)
            else:
                self.protocol.receive_eof()
            for event in self.protocol.events_received():
                if isinstance(event, Request):
                    self._shake_hands(event)
                    if self.protocol.state is State.OPEN:
                        yield b""
                elif event.opcode in (Opcode.TEXT, Opcode.BINARY, Opcode.CONT):
                    parts.append(event.data)
                    if sum(map(len, parts)) > MESSAGE_BYTES:
                        self.protocol.fail(1009)
                    elif event.fin:
                        message, parts = b"".join(parts), []
                        yield message
            self._flush()
            if not data or self.protocol.close_expected():
                return

    def send(self, text: str) -> None:
        """Sends a message."""
        self.protocol.send_text(text.encode())
        self._flush()

    def close(self) -> None:
        """Says goodbye, and waits a moment for the other side's."""
        if self.protocol.state is State.OPEN:
            self.protocol.send_close(1000)
            self._flush()
            self.connection.settimeout(1.0)
            for _ in self.messages():
                pass

    def _shake_hands(self, request: Request) -> None:
        path = request.path.partition("?")[0]
        page = self.page(path)
        if page is not None:
            response = self.protocol.reject(http.HTTPStatus.OK, page)
            del response.headers["Content-Type"]
            response.headers["Content-Type"] = "application/json"
        elif path == "/ws":
            response = self.protocol.accept(request)
        else:
            response = self.protocol.reject(http.HTTPStatus.NOT_FOUND, "Sessions are at /ws.\n")
        self.protocol.send_response(response)
        self._flush()

    def _flush(self) -> None:
        for data in self.protocol.data_to_send():
            if data:
                self.connection.sendall(data)
            else:
                self.connection.shutdown(socket.SHUT_WR)


def own_stdout() -> TextIO:
    """Standard output for this program alone: what packages print, in any language, goes to standard error from now on."""
    sys.stdout.flush()
    own = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    return own


def serve_until_stdin_closes(server: Server, out: TextIO, keeps_serving: bool) -> None:
    """Prints where the server listens, then serves. Whoever started it is gone when standard input closes: then it ends."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    out.write(json.dumps({"url": server.url, "protocol": "openenv", "version": 1}) + "\n")
    out.flush()
    serving = threading.Thread(target=server.serve, daemon=True)
    serving.start()
    try:
        if keeps_serving:
            serving.join()
        else:
            while os.read(0, 4096):
                pass
    except KeyboardInterrupt:
        pass
    # An environment that hangs does not keep the process.
    last = threading.Timer(CLOSING_TIME, os._exit, (0,))
    last.daemon = True
    last.start()
    server.close()
