"""A policy behind `--policy ws:HOST:PORT`: vla-eval's protocol, MessagePack messages over a WebSocket.

As an example it serves chance: `python -m sprint_env.policy_server --port 8000`. For your own policy call `serve` with
something that makes it; each connection has one of its own. Needs the packages websockets and msgpack.
"""

import argparse
import random
import time

import msgpack
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve as listen

LARGEST = 64 << 20


class RandomPolicy:
    """Any action that is possible, and any of the arguments that it could take."""

    def begin(self, episode):
        """An episode begins; `episode["task"]` has its name, environment and seed."""
        self.chance = random.Random(episode["task"]["seed"])

    def act(self, observation):
        """What to do now: at least an action, by its name or its place in `observation["actions"]`."""
        possible = [at for at, legal in enumerate(observation["legal"]) if legal]
        action = self.chance.choice(possible)
        legal = observation["legal"][action]
        weights = [1 / len(possible) if at in possible else 0.0 for at in range(len(observation["legal"]))]
        argument = self.chance.choice(legal) if isinstance(legal, list) else None
        return {"action": action, "argument": argument, "probabilities": weights}


def serve(make_policy, port, name, host="127.0.0.1"):
    """Serves until it is interrupted; port 0 takes a free one. Prints where it listens."""

    def converse(socket):
        policy = make_policy()
        try:
            for message in socket:
                message = msgpack.unpackb(message)
                kind, payload = message["type"], message["payload"]
                try:
                    if kind == "hello":
                        answer = "hello", {"protocol_version": 1, "harness_version": "0", "model_server": name}
                    elif kind == "observation":
                        answer = "action", policy.act(payload)
                    else:
                        if kind == "episode_start":
                            policy.begin(payload)
                        continue
                except Exception as problem:  # told to whoever evaluates, in the place of an answer
                    answer = "error", {"error": f"{type(problem).__name__}: {problem}"}
                fields = {"type": answer[0], "payload": answer[1], "seq": message["seq"], "timestamp": time.time()}
                socket.send(msgpack.packb(fields))
        except ConnectionClosed:
            pass

    with listen(converse, host, port, compression=None, max_size=LARGEST, ping_interval=None) as server:
        print(f"ws:{host}:{server.socket.getsockname()[1]}", flush=True)
        server.serve_forever()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=8000)
    serve(RandomPolicy, parser.parse_args().port, "random")
