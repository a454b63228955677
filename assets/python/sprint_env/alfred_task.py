"""ALFRED's recorded tasks: how a scene is set, what is asked, and when it is done."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .environment import CannotDo

Thing = dict[str, Any]


@dataclass
class Changes:
    """What was done to things in an episode, by their ids; the simulator itself does not remember it."""

    cleaned: set[str] = field(default_factory=set)
    heated: set[str] = field(default_factory=set)
    cooled: set[str] = field(default_factory=set)


@dataclass(frozen=True)
class Goal:
    """What has to hold at the end, by ALFRED's kind of task and the names in it."""

    kind: str
    target: str
    place: str
    carrier: str
    lamp: str

    def met(self, things: list[Thing], held: set[str], changes: Changes) -> bool:
        """Whether it holds."""
        targets = _named(things, self.target)
        places = _named(things, self.place, "receptacle")
        match self.kind:
            case "pick_and_place_simple":
                return _any_in(targets, places)
            case "pick_two_obj_and_place":
                return any(len(_inside(targets, place)) >= 2 for place in places)
            case "look_at_obj_in_light":
                lamps = _named(things, self.lamp, "toggleable")
                is_lit = any(lamp["isToggled"] and lamp["visible"] for lamp in lamps)
                return is_lit and any(target["objectId"] in held for target in targets)
            case "pick_and_place_with_movable_recep":
                carriers = [it for it in _named(things, self.carrier, "receptacle") if it["pickupable"]]
                laden = [carrier for carrier in carriers if _inside(targets, carrier)]
                return _any_in(laden, places)
            case "pick_clean_then_place_in_recep":
                return _any_in(_changed(targets, changes.cleaned), places)
            case "pick_heat_then_place_in_recep":
                return _any_in(_changed(targets, changes.heated), places)
            case "pick_cool_then_place_in_recep":
                return _any_in(_changed(targets, changes.cooled), places)
            case _:
                raise CannotDo(f"task_type: {self.kind!r} is none of ALFRED's")


@dataclass(frozen=True)
class AlfredTask:
    """A task as ALFRED's `traj_data.json` has it."""

    name: str
    scene: str
    poses: list[Thing]
    toggles: list[Thing]
    dirty_and_empty: bool
    start: Thing
    missions: list[str]
    goal: Goal


def read_task(path: Path) -> AlfredTask:
    """Reads a `traj_data.json`."""
    try:
        told = json.loads(path.read_text())
        scene, asked = told["scene"], told["pddl_params"]
        missions = [annotation["task_desc"].strip() for annotation in told["turk_annotations"]["anns"]]
        sliced = "Sliced" if asked["object_sliced"] else ""
        goal = Goal(
            kind=told["task_type"],
            target=asked["object_target"] + sliced,
            place=asked["parent_target"],
            carrier=asked["mrecep_target"],
            lamp=asked["toggle_target"],
        )
        return AlfredTask(
            name=told.get("task_id", path.parent.name),
            scene=scene["floor_plan"],
            poses=scene["object_poses"],
            toggles=scene["object_toggles"],
            dirty_and_empty=scene["dirty_and_empty"],
            start=dict(scene["init_action"]),
            missions=missions or ["look around"],
            goal=goal,
        )
    except OSError as problem:
        raise CannotDo(f"{path}: {problem.strerror}") from problem
    except (ValueError, KeyError, TypeError) as problem:
        raise CannotDo(f"{path}: this is no traj_data.json of ALFRED ({type(problem).__name__}: {problem})") from problem


def find_tasks(paths: Iterable[str]) -> list[AlfredTask]:
    """The tasks of these files, and of every `traj_data.json` in these folders, in the order of their names."""
    found: list[Path] = []
    for text in paths:
        path = Path(text)
        found += sorted(path.rglob("traj_data.json")) if path.is_dir() else [path]
    if not found:
        raise CannotDo("no traj_data.json was found")
    return [read_task(path) for path in found]


def _named(things: list[Thing], name: str, property: str | None = None) -> list[Thing]:
    """Things whose id contains a name, as ALFRED looks for them."""
    return [it for it in things if name and name in it["objectId"] and (property is None or it[property])]


def _inside(things: list[Thing], place: Thing) -> list[Thing]:
    held = place["receptacleObjectIds"] or []
    return [it for it in things if it["objectId"] in held]


def _any_in(things: list[Thing], places: list[Thing]) -> bool:
    return any(_inside(things, place) for place in places)


def _changed(things: list[Thing], ids: set[str]) -> list[Thing]:
    """Slices are changed where they are, or where their whole was."""
    return [it for it in things if it["objectId"] in ids or whole(it["objectId"]) in ids]


def whole(identifier: str) -> str:
    """The id without the name of a part: a slice's whole."""
    return "|".join(identifier.split("|")[:4])
