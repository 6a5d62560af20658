"""Devices by name: `mouse`, `virtual:<script>`, `replay:<file>`, … as typed after `--left` and `--right`.

A device fulfils `core.Device`: metres, buttons as bits and newtons in its own frame. It is one file with
`create(spec)` and, for hardware, `find_devices()`, and one row of `KINDS`; open `mouse` first, the
shortest.

    mouse, virtual, replay             software: the page's pointer, a script, a recording
    spacemouse, dualsense              by HID: `hid` has what they share, `hid_ports` the system's side
    openhaptics                        3D Systems Touch; `libhd` is its library
    inverse3                           Haply; `inverse3_messages` is its protocol
    forcedimension                     Force Dimension and Novint Falcon
    ros1                               a driver that publishes poses in ROS 1
    exchange                           where the servo's thread meets that of a driver
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import Literal

from otwarp.errors import InputError
from otwarp.haptics.core import Device

MOST_HANDS = 2


@dataclass(frozen=True, slots=True)
class Kind:
    """A row of the table of devices.

    Attributes:
        home: `module:function`, imported when used; the function takes a `DeviceSpec` and returns a `Device`.
        argument: What comes after the colon: `required`, `optional` or `none`.
        means: What the argument is, for messages.
        several: Whether both sides may name the same one: software is made anew for each, hardware is not.
        probe: Whether it may be opened and closed to see whether it is there, without moving or calibrating anything.
        keeps: What keeps the last force if the servo is killed: `nothing` (software, or no motors); a `driver` outside
            of the servo's process, to which the guardian sends zero force (its module has `zero_force`, see
            `core.ZeroForce`); or a `library` in it, which ends with it, and the device's own timeout acts.
        met_hardware: Whether the binding was ever run on the hardware; of software, True.
    """

    home: str
    argument: Literal["required", "optional", "none"]
    means: str
    several: bool
    probe: bool = False
    keeps: Literal["nothing", "driver", "library"] = "nothing"
    met_hardware: bool = True

    @property
    def caution(self) -> str:
        """What who uses a kind must know whose binding never met one, or ""."""
        return "" if self.met_hardware else "this way was tested on doubles; no such device has met it"


KINDS: dict[str, Kind] = {
    "mouse": Kind("otwarp.haptics.devices.mouse:create", "none", "", True),
    "virtual": Kind("otwarp.haptics.devices.virtual:create", "required", "a script, as circle,radius=0.02", True),
    "replay": Kind(
        "otwarp.haptics.devices.replay:create", "required", "a recording, .mcap, .csv or .jsonl", True, True
    ),
    "spacemouse": Kind(
        "otwarp.haptics.devices.spacemouse:create",
        "optional",
        "a serial, #2, speed=0.1",
        False,
        True,
        met_hardware=False,
    ),
    "dualsense": Kind(
        "otwarp.haptics.devices.dualsense:create",
        "optional",
        "a serial, #2, speed=0.1",
        False,
        True,
        "driver",
        met_hardware=False,
    ),
    "ros1": Kind(
        "otwarp.haptics.devices.ros1:create",
        "required",
        "a namespace, as /GeomagicLeft",
        False,
        True,
        "driver",
        met_hardware=False,
    ),
    "openhaptics": Kind(
        "otwarp.haptics.devices.openhaptics:create",
        "optional",
        "its name in Touch Setup",
        False,
        keeps="library",
        met_hardware=False,
    ),
    "inverse3": Kind(
        "otwarp.haptics.devices.inverse3:create",
        "optional",
        "its id, or ws://host:port/id",
        False,
        True,
        "driver",
        met_hardware=False,
    ),
    "forcedimension": Kind(
        "otwarp.haptics.devices.forcedimension:create",
        "optional",
        "its serial number, or index=N",
        False,
        keeps="library",
        met_hardware=False,
    ),
}
"""One row per kind. A new device adds its file and its row."""

ALIASES = {"haply": "inverse3"}
"""Other names of kinds."""


@dataclass(frozen=True, slots=True)
class DeviceSpec:
    """A device as asked for.

    Attributes:
        text: As typed.
        kind: Row of `KINDS`.
        argument: After the colon, or None.
        hand: Index of the side.
        ordinal: How many sides before this one asked for the same kind without saying which: 1 takes the second
            SpaceMouse that is found.
        pointer: Name of the mailbox in which the page writes the pointer, for `mouse`.
        name: `left` or `right`, None where nobody said.
    """

    text: str
    kind: str
    argument: str | None
    hand: int = 0
    ordinal: int = 0
    pointer: str | None = None
    name: str | None = None


def parse_devices(
    texts: Sequence[str], pointers: Sequence[str | None] = (), names: Sequence[str | None] = ()
) -> tuple[DeviceSpec, ...]:
    """The devices of all sides, in their order.

    Args:
        texts: `kind` or `kind:argument` of each hand; quotes around the argument are taken off.
        pointers: Names of the pointer mailboxes, for hands that are a `mouse`.
        names: `left` or `right` of each hand.

    Raises:
        InputError: Unknown kind, missing or superfluous argument, too many hands, or one device for two hands.
    """
    if not 1 <= len(texts) <= MOST_HANDS:
        raise InputError(f"devices = {list(texts)!r}: must be 1 to {MOST_HANDS} of them")
    specs: list[DeviceSpec] = []
    for hand, text in enumerate(texts):
        name, colon, rest = text.strip().partition(":")
        name = ALIASES.get(name, name)
        kind, argument = KINDS.get(name), rest.strip().strip("\"'") or None
        if kind is None:
            known = sorted({*KINDS, *ALIASES})
            near = get_close_matches(name.lower(), known, 1)
            hint = f" (did you mean {near[0]}?)" if near else ""
            raise InputError(f"device {text!r}: unknown kind {name!r}{hint}; must be one of {', '.join(known)}")
        if kind.argument == "required" and argument is None:
            raise InputError(f"device {text!r}: must be {name}:<{kind.means}>")
        if kind.argument == "none" and colon:
            raise InputError(f"device {text!r}: {name} takes nothing after it")
        same = [spec for spec in specs if spec.kind == name]
        # a ROS namespace is the same with and without its first slash
        there = [spec.argument.strip("/") for spec in same if spec.argument is not None]
        if argument is not None and not kind.several and argument.strip("/") in there:
            raise InputError(f"device {text!r}: both hands name it; each hand must have its own")
        if not kind.several and same and (argument is None) != (same[0].argument is None):
            raise InputError(f"devices {same[0].text!r} and {text!r}: name both or neither, lest they be the same one")
        ordinal = sum(spec.argument is None for spec in same)
        pointer = pointers[hand] if hand < len(pointers) else None
        called = names[hand] if hand < len(names) else None
        specs.append(DeviceSpec(text, name, argument, hand, ordinal, pointer, called))
    return tuple(specs)


def create_device(spec: DeviceSpec) -> Device:
    """The device that a spec asks for, not opened.

    Raises:
        InputError: Its argument is bad.
    """
    module, function = KINDS[spec.kind].home.split(":")
    return getattr(import_module(module), function)(spec)


def probe_devices(specs: Sequence[DeviceSpec]) -> None:
    """Make all devices, and open and close those that may be: what is wrong is an error before long work begins.

    Raises:
        InputError: The argument of one is bad, or one that may be opened is not there.
    """
    for spec in specs:
        device = create_device(spec)
        if KINDS[spec.kind].probe:
            try:
                device.open()
            finally:
                device.close()


def parse_parameters(where: str, text: str, allowed: Sequence[str]) -> tuple[str, dict[str, str]]:
    """`name,key=value,key=value` as (name, {key: value}).

    Raises:
        InputError: A word without `=`, a key that is not allowed or comes twice.
    """
    name, *words = (word.strip() for word in text.split(","))
    found: dict[str, str] = {}
    for word in words:
        key, equals, value = (part.strip() for part in word.partition("="))
        if not equals or key not in allowed or key in found:
            raise InputError(f"{where}: {word!r} must be one of {', '.join(allowed)} with '=value', each once")
        found[key] = value
    return name, found


def parse_number(where: str, key: str, text: str | None, default: float, low: float, high: float) -> float:
    """A parameter within its range, or its default where it was not given.

    Raises:
        InputError: No number, or out of range.
    """
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise InputError(f"{where}: {key} = {text} must be a number from {low:g} to {high:g}")
    return value
