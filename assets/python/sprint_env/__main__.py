"""`python -m sprint_env`: serves an environment to the program that started it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from typing import Any

from .environment import CannotDo, Environment
from .server import Server, own_stdout, serve_until_stdin_closes


def main() -> int:
    """Reads the command line, and serves until standard input closes."""
    arguments = _parser().parse_args()
    out = own_stdout()
    try:
        make: Callable[[], Environment] = arguments.maker(arguments)
        # What is wrong with it is said now, not to the first who connects.
        server = Server(make, make(), arguments.host, arguments.port)
    except ModuleNotFoundError as missing:
        package = (missing.name or "").partition(".")[0]
        print(f"error: the package {package} is missing: pip install {package}", file=sys.stderr)
        return 1
    except (CannotDo, ImportError, OSError) as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 1
    serve_until_stdin_closes(server, out, arguments.keep_serving)
    return 0


def _parser() -> argparse.ArgumentParser:
    serving = argparse.ArgumentParser(add_help=False)
    serving.add_argument("--host", default="127.0.0.1", help="the address to listen on [%(default)s]")
    serving.add_argument("--port", type=int, default=0, help="the port to listen on [0: any that is free]")
    serving.add_argument(
        "--keep-serving", action="store_true", help="go on when standard input closes, until Ctrl-C or a signal"
    )
    parser = argparse.ArgumentParser(prog="python -m sprint_env", description=__doc__)
    kinds = parser.add_subparsers(required=True, metavar="KIND")
    gym = kinds.add_parser("gym", parents=[serving], help="an environment of Gymnasium, Minigrid or BabyAI")
    gym.add_argument("name", help="its name, or MODULE:NAME where importing a module registers it")
    gym.add_argument("--tile", type=int, default=8, help="Minigrid: pixels a side of a cell [%(default)s]")
    gym.add_argument(
        "--option", action="append", type=_option, default=[], metavar="KEY=VALUE", help="passed to gymnasium.make"
    )
    gym.set_defaults(maker=_gym)
    games = kinds.add_parser("textworld", parents=[serving], help="games of TextWorld")
    games.add_argument("files", nargs="*", metavar="GAME", help="game files, for seeds in turn [generated for each seed]")
    games.add_argument("--rooms", type=int, default=3, help="rooms of a generated game [%(default)s]")
    games.add_argument("--objects", type=int, default=6, help="objects of a generated game [%(default)s]")
    games.add_argument("--quest", type=int, default=3, help="commands that a generated game asks for [%(default)s]")
    games.add_argument("--steps", type=int, default=100, help="commands after which a game ends [%(default)s]")
    games.set_defaults(maker=_textworld)
    thor = kinds.add_parser("thor", parents=[serving], help="AI2-THOR with ALFRED's tasks")
    thor.add_argument("tasks", nargs="+", metavar="TASK", help="traj_data.json files of ALFRED, or folders of them")
    thor.add_argument("--steps", type=int, default=1000, help="actions after which an episode ends [%(default)s]")
    thor.add_argument("--executable", help="a player of AI2-THOR [the one that the package ai2thor fetches]")
    thor.add_argument("--player-port", type=int, help="wait at this port for a player that is started by other means")
    thor.set_defaults(maker=_thor)
    return parser


def _gym(arguments: argparse.Namespace) -> Callable[[], Environment]:
    def make() -> Environment:
        from .make_gym import make

        return make(arguments.name, arguments.tile, dict(arguments.option))

    return make


def _textworld(arguments: argparse.Namespace) -> Callable[[], Environment]:
    from .textworld_environment import Games, GameSize, TextWorldEnvironment

    games = Games(arguments.files, GameSize(arguments.rooms, arguments.objects, arguments.quest))
    return lambda: TextWorldEnvironment(games, arguments.steps)


def _thor(arguments: argparse.Namespace) -> Callable[[], Environment]:
    from .alfred_task import find_tasks
    from .thor_environment import ThorEnvironment, open_controller

    tasks = find_tasks(arguments.tasks)

    def make() -> Environment:
        controller = open_controller(tasks[0].scene, arguments.executable, arguments.player_port)
        return ThorEnvironment(controller, tasks, arguments.steps)

    return make


def _option(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"{text!r} is not KEY=VALUE")
    try:
        return key, json.loads(value)
    except ValueError:
        return key, value


if __name__ == "__main__":
    sys.exit(main())
