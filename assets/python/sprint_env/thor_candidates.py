"""What an agent of ALFRED could do now, from AI2-THOR's metadata alone."""

from __future__ import annotations

import math
from typing import Any

from .alfred_classes import CLASSES

Thing = dict[str, Any]

NAVIGATION = ("MoveAhead", "RotateLeft", "RotateRight", "LookUp", "LookDown")
INTERACTIONS = ("Pickup", "Put", "Open", "Close", "ToggleOn", "ToggleOff", "Slice")
#: How far the agent reaches, in metres.
REACH = 1.5
KNIVES = ("Knife", "ButterKnife")
#: Versions of AI2-THOR spell names differently in their letters' size.
BY_LETTERS = {name.lower(): name for name in CLASSES}


def class_of(identifier: str) -> str | None:
    """A thing's class by its id; None for one that no action may name."""
    return BY_LETTERS.get(identifier.split("|")[0].lower())


def candidates(metadata: dict[str, Any]) -> dict[str, list[Thing]]:
    """For each interaction, what it could be done to, nearest first."""
    here = metadata["agent"]["position"]
    held = held_class(metadata)
    near = [it for it in metadata["objects"] if it["visible"] and in_reach(here, it) and class_of(it["objectId"])]
    near.sort(key=lambda it: _away(here, it))
    usable = _without_lone_faucet(near)
    return {
        "Pickup": [it for it in near if it["pickupable"] and held is None and not it.get("isPickedUp")],
        "Put": [it for it in near if it["receptacle"] and not _is_shut(it) and held is not None],
        "Open": [it for it in near if it["openable"] and not it["isOpen"] and not it["isToggled"]],
        "Close": [it for it in near if it["openable"] and it["isOpen"]],
        "ToggleOn": [it for it in usable if it["toggleable"] and not it["isToggled"]],
        "ToggleOff": [it for it in near if it["toggleable"] and it["isToggled"]],
        "Slice": [it for it in near if it["sliceable"] and not it["isSliced"] and held in KNIVES],
    }


def held_class(metadata: dict[str, Any]) -> str | None:
    """The class of what is in the hand."""
    inventory = metadata["inventoryObjects"]
    return class_of(inventory[0]["objectId"]) if inventory else None


def in_reach(here: dict[str, float], thing: Thing) -> bool:
    """Whether the agent could touch it from where it stands, as the paper's code counts it."""
    there = thing["position"]
    across = [there[axis] - here[axis] for axis in "xyz"]
    return max(map(abs, across)) <= REACH and across[0] ** 2 + across[2] ** 2 <= REACH**2


def _away(here: dict[str, float], thing: Thing) -> float:
    return math.dist([here[axis] for axis in "xyz"], [thing["position"][axis] for axis in "xyz"])


def _is_shut(thing: Thing) -> bool:
    return thing["openable"] and not thing["isOpen"]


def _without_lone_faucet(near: list[Thing]) -> list[Thing]:
    """A faucet whose sink is not in view is not for use; only the first is taken away, as in the paper's code."""
    if any("SinkBasin" in it["objectId"] for it in near):
        return near
    lone = next((it for it in near if class_of(it["objectId"]) == "Faucet"), None)
    return [it for it in near if it is not lone]
