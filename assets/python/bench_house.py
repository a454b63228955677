"""Steps a second of House in Python. `python bench_house.py [STEPS]`; the program is found as `HouseEnv` finds it."""

from __future__ import annotations

import sys
import time

import numpy

from sprint_env.house_env import HouseEnv

#: Turns, steps and looks: what an agent does most.
MOVES = 5
#: The best of so many rounds is told: other work on the machine makes the others worse.
ROUNDS = 5


def main() -> None:
    """Plays houses in turn with random moves, with and without the table of what is possible."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 4000
    for size, legal in [(128, False), (128, True), (300, False), (300, True)]:
        env = HouseEnv(["--houses", "8"], size=size, legal=legal)
        moves = numpy.random.default_rng(0).integers(MOVES, size=steps)
        for seed in range(8):
            env.reset(seed=seed)
        best = max(rate(env, moves) for _ in range(ROUNDS))
        table = "with what is possible" if legal else "frames alone"
        print(f"{size} x {size}, {table}: {best:.0f} steps a second")
        env.close()


def rate(env: HouseEnv, moves: numpy.ndarray) -> float:
    """Steps a second of one round, resets included."""
    start = time.perf_counter()
    env.reset(seed=0)
    for number, move in enumerate(moves):
        _, _, terminated, truncated, _ = env.step((move, 0))
        if terminated or truncated:
            env.reset(seed=number % 8)
    return len(moves) / (time.perf_counter() - start)


if __name__ == "__main__":
    main()
