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
    make: Callable[[], Environment] = arguments.maker(arguments)
    try:
        # What is wrong with it is said now, not to the first who connects.
        first = make()
        capabilities = first.capabilities()
        first.close()
        server = Server(make, capabilities, arguments.host, arguments.port)
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
    return parser


def _gym(arguments: argparse.Namespace) -> Callable[[], Environment]:
    def make() -> Environment:
        from .make_gym import make

        return make(arguments.name, arguments.tile, dict(arguments.option))

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
