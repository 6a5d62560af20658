"""What the Haply Inverse Service and its clients say to each other on the simulation channel, as JSON text.

The protocol is that of versions 3.1 to 3.5 of the service: https://docs.haply.co/inverseSDK/service, pages Simulation
Channel (3.4, 3.5), WebSocket Protocol, Control Commands, Basis Permutation and JSON Conventions (3.5), and the Python
example of 3.1. On connection the service sends an inventory of all devices with their configuration; then exactly one
state of all devices for each message that it gets. Metres, newtons; x right, y forward, z up.

A force is `set_cursor_force: {"values": …}` in 3.1 to 3.4 and `{"vector": …}` in 3.5, whose inventory is also the first
with a `session_id`; a service that knows neither key would ignore the force without a word.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from otwarp.haptics.core import Vec3

FARTHEST = 10.0
"""Metres; no hand is farther from its device."""
GRIPS = ("wireless_verse_grip", "verse_grip")
"""Where handles with buttons are listed: radio, then cable."""
_BUTTONS = (("a", 1), ("b", 2), ("c", 4))


@dataclass(frozen=True, slots=True)
class Inventory:
    """The first message.

    Attributes:
        devices: Ids of the Inverse3, in the service's order.
        grips: Ids of the handles, those by radio first.
        key: What a force is called by this version.
        unready: Ids of those Inverse3 whose status says that they are not ready.
    """

    devices: tuple[str, ...]
    grips: tuple[str, ...]
    key: str
    unready: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class CursorState:
    """One device in a message.

    Attributes:
        present: Whether the message lists it.
        position: Of the cursor in our device frame [m], or None while the device is not ready.
        buttons: a, b, c of the handle, or the one button of a handle with a cable, as bits 0, 1, 2.
    """

    present: bool
    position: Vec3 | None = None
    buttons: int = 0


ABSENT = CursorState(False)


class BadMessage(ValueError):
    """A message that is not what the protocol says."""


def read_inventory(message: str | bytes) -> Inventory:
    """The devices that the service has.

    Raises:
        BadMessage: It is no inventory.
    """
    found = _parse(message)
    grips = tuple(_id(grip) for group in GRIPS for grip in _list(found, group))
    key = "vector" if "session_id" in found else "values"
    devices = _list(found, "inverse3")
    unready = frozenset(_id(device) for device in devices if not _ready(device))
    return Inventory(tuple(_id(device) for device in devices), grips, key, unready)


def read_state(message: str | bytes, device: str, grip: str | None) -> CursorState:
    """One device in a message, with the buttons of its handle.

    Args:
        message: As received.
        device: Id of the Inverse3.
        grip: Id of the handle; None for no buttons.

    Raises:
        BadMessage: It is not what the protocol says.
    """
    found = _parse(message)
    for entry in _list(found, "inverse3"):
        if _id(entry) == device:
            position = _position(_dict(entry, "state")) if _ready(entry) else None
            return CursorState(True, position, _buttons(found, grip) if grip is not None else 0)
    return ABSENT


def force_command(device: str, force: Vec3, key: str) -> str:
    """The message that renders a force [N], given in our device frame."""
    x, y, z = force
    vector = {"x": x, "y": -z, "z": y}
    return json.dumps({"inverse3": [{"device_id": device, "commands": {"set_cursor_force": {key: vector}}}]})


def greeting(device: str, key: str) -> str:
    """The first message of a client: no force, and, in 3.5, axes as the service has them by itself.

    It leaves out the name of a profile: for a name, Haply Hub applies the scales and mounts that somebody set with it,
    and a force times a motion would no longer be the work that the hand does.
    """
    words = json.loads(force_command(device, (0.0, 0.0, 0.0), key))
    if key == "vector":
        words["session"] = {"configure": {"basis": {"permutation": "XYZ"}}}
    return json.dumps(words)


def _parse(message: str | bytes) -> dict[str, Any]:
    try:
        found = json.loads(message)
    except (ValueError, RecursionError) as error:
        raise BadMessage(f"no JSON: {error}") from None
    if not isinstance(found, dict):
        raise BadMessage("no object")
    return found


def _list(found: dict[str, Any], name: str) -> list[Any]:
    """A list of objects, empty if it is not there."""
    listed = found.get(name, [])
    if not isinstance(listed, list) or not all(isinstance(entry, dict) for entry in listed):
        raise BadMessage(f"{name} is no list of objects")
    return listed


def _dict(found: dict[str, Any], name: str) -> dict[str, Any]:
    """An object, empty if it is not there."""
    inner = found.get(name, {})
    if not isinstance(inner, dict):
        raise BadMessage(f"{name} is no object")
    return inner


def _id(entry: dict[str, Any]) -> str:
    found = entry.get("device_id")
    if not isinstance(found, str) or not found:
        raise BadMessage("device_id is no name")
    return found


def _ready(entry: dict[str, Any]) -> bool:
    return _dict(entry, "status").get("ready", True) is True


def _position(state: dict[str, Any]) -> Vec3:
    cursor = _dict(state, "cursor_position")
    x, y, z = (_metres(cursor.get(axis)) for axis in "xyz")
    return (x, z, -y)


def _metres(value: object) -> float:
    # to Python a bool is an int; NaN and integers beyond a float fail the comparison
    if isinstance(value, bool) or not isinstance(value, int | float) or not -FARTHEST <= value <= FARTHEST:
        raise BadMessage("cursor_position is not three numbers of metres")
    return float(value)


def _buttons(found: dict[str, Any], grip: str) -> int:
    """Bits of the pressed buttons; none if the handle is away."""
    for group in GRIPS:
        for entry in _list(found, group):
            if _id(entry) == grip:
                state = _dict(entry, "state")
                pressed = _dict(state, "buttons")
                bits = sum(bit for name, bit in _BUTTONS if pressed.get(name) is True)
                return bits | (state.get("button") is True)
    return 0
