#!/usr/bin/env python3
"""An environment in another process, for tests: a corridor of eight cells whose right end is the goal.

Standard library alone. `SPRINT_PYTHON` may name this file: then it is a child of the program's; its arguments end in the id,
which says what it does wrong (see `FAULTS`). With `serve` it is a server that prints its address.
"""

import base64
import hashlib
import json
import os
import socket
import struct
import sys
import threading
import time

FAULTS = ["none", "dies", "hangs", "forks", "late", "deaf", "rubbish", "dies-at-start", "no-snapshot"]


def read_exactly(connection, count):
    data = b""
    while len(data) < count:
        more = connection.recv(count - len(data))
        if not more:
            raise EOFError
        data += more
    return data


def read_message(connection):
    while True:
        first, second = read_exactly(connection, 2)
        length = second & 127
        if length == 126:
            (length,) = struct.unpack(">H", read_exactly(connection, 2))
        elif length == 127:
            (length,) = struct.unpack(">Q", read_exactly(connection, 8))
        mask = read_exactly(connection, 4)
        data = bytes(byte ^ mask[i % 4] for i, byte in enumerate(read_exactly(connection, length)))
        if first & 15 == 8:
            raise EOFError
        if first & 15 == 1:
            return json.loads(data)


def write_message(connection, message):
    data = json.dumps(message).encode()
    head = bytes([0x81, len(data)]) if len(data) < 126 else b"\x81\x7e" + struct.pack(">H", len(data))
    connection.sendall(head + data)


def shake_hands(connection):
    head = b""
    while b"\r\n\r\n" not in head:
        head += connection.recv(4096)
    key = next(line.split(b": ")[1] for line in head.split(b"\r\n") if line.lower().startswith(b"sec-websocket-key"))
    accept = base64.b64encode(hashlib.sha1(key + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest())
    connection.sendall(
        b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: "
        + accept + b"\r\n\r\n"
    )


def seen(cell):
    width, height = 8, 4
    pixels = b"".join(bytes([250, 40, 40]) if x == cell else bytes([30, 30, 90]) for _ in range(height) for x in range(width))
    frame = {"encoding": "raw", "width": width, "height": height, "data": base64.b64encode(pixels).decode()}
    observation = {"frame": frame, "mission": "go to the right end", "legal": [cell > 0, True], "success": cell == 7,
                   "terminated": cell == 7, "truncated": False}
    return {"type": "observation", "data": {"observation": observation, "reward": float(cell == 7), "done": cell == 7}}


def converse(connection, fault):
    shake_hands(connection)
    cell = steps = 0
    while True:
        request = read_message(connection)
        kind, data = request["type"], request.get("data") or {}
        if kind == "capabilities":
            actions = [{"name": name, "argument": None} for name in ("left", "right")]
            answer = {"name": "Corridor", "actions": actions, "arguments": {}, "seeds": True, "frame": [8, 4],
                      "snapshot": fault != "no-snapshot", "deterministic": True, "formats": ["raw"]}
            answer = {"type": "capabilities", "data": answer}
        elif kind == "reset":
            cell, steps = data.get("seed", 0) % 5, 0
            answer = seen(cell)
        elif kind == "step":
            steps += 1
            if steps == 3 and fault == "dies":
                print("Traceback (most recent call last):\nRuntimeError: the physics exploded", file=sys.stderr, flush=True)
                os._exit(3)
            if steps == 3 and fault in ("hangs", "deaf"):
                time.sleep(3600)
            if steps == 3 and fault == "late":
                time.sleep(3)
            cell = min(cell + 1, 7) if data["action"] == "right" else max(cell - 1, 0)
            answer = seen(cell)
        elif kind == "snapshot":
            answer = {"type": "snapshot", "data": {"id": str(cell)}}
        elif kind == "restore":
            cell = int(data["id"])
            answer = seen(cell)
        elif kind == "close":
            return
        else:
            answer = {"type": "error", "data": {"message": f"Unknown message type: {kind}", "code": "UNKNOWN_TYPE"}}
        write_message(connection, answer)


def serve(listener, fault):
    def one(connection):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            converse(connection, fault)
        except (EOFError, OSError):
            pass
        connection.close()

    while True:
        connection, _ = listener.accept()
        threading.Thread(target=one, args=(connection,), daemon=True).start()


def main():
    fault = next((word for word in sys.argv[1:] if word in FAULTS), "none")
    if fault == "dies-at-start":
        sys.exit("ModuleNotFoundError: No module named 'minigrid'")
    if fault == "rubbish":
        print("pygame 2.6.0 (SDL 2.28.4)", flush=True)
    if fault == "forks" and os.fork() == 0:
        time.sleep(3600)
    listener = socket.create_server(("127.0.0.1", 0))
    url = f"ws://127.0.0.1:{listener.getsockname()[1]}/ws"
    print(json.dumps({"url": url, "protocol": "openenv", "version": 1}), flush=True)
    threading.Thread(target=serve, args=(listener, fault), daemon=True).start()
    if fault == "deaf":
        time.sleep(3600)
    sys.stdin.read()
    os._exit(0)


main()
