"""A 3Dconnexion SpaceMouse: the cap's deflection is the hand's velocity; it renders no force.

Reports, numbers little-endian (the source of each fact is in docs/haptics_devices_hid.md):

- 1: three int16, translation; on wireless models six, translation and rotation.
- 2: three int16, rotation.
- 3: buttons, a bit each, from bit 0 of the first byte on.

The binding never met a SpaceMouse. Its tests decode bytes that others recorded from a SpaceNavigator and a SpaceMouse
Compact, and bytes made to the documented layout of the wireless models.
"""

from __future__ import annotations

import math
import struct

from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec
from otwarp.haptics.devices.hid import (
    HidFound,
    HidPort,
    HidSystem,
    HidWanted,
    RateHand,
    describe_devices,
    open_hid,
    parse_argument,
    waiting_reports,
)
from otwarp.haptics.devices.hid_ports import hid_system

MODELS = {
    (0x046D, 0xC623): "SpaceTraveler",
    (0x046D, 0xC625): "SpacePilot",
    (0x046D, 0xC626): "SpaceNavigator",
    (0x046D, 0xC627): "SpaceExplorer",
    (0x046D, 0xC628): "SpaceNavigator for Notebooks",
    (0x046D, 0xC629): "SpacePilot Pro",
    (0x046D, 0xC62B): "SpaceMouse Pro",
    (0x256F, 0xC62E): "SpaceMouse Wireless, by cable",
    (0x256F, 0xC62F): "SpaceMouse Wireless",
    (0x256F, 0xC631): "SpaceMouse Pro Wireless, by cable",
    (0x256F, 0xC632): "SpaceMouse Pro Wireless",
    (0x256F, 0xC633): "SpaceMouse Enterprise",
    (0x256F, 0xC635): "SpaceMouse Compact",
    (0x256F, 0xC636): "SpaceMouse Module",
    (0x256F, 0xC638): "SpaceMouse Pro Wireless, Bluetooth edition",
    (0x256F, 0xC63A): "SpaceMouse Wireless, Bluetooth edition",
    (0x256F, 0xC652): "Universal Receiver",
}
"""By (vendor, product). Older models, whose axes differ, are not here."""
USAGE = (0x01, 0x08)
"""Generic Desktop, Multi-axis Controller."""
FULL = 350.0
"""Counts of full deflection: the logical maximum in the report descriptors of SpaceNavigator and SpaceMouse Wireless.
Some caps go beyond; that counts as full."""
SILENCE = 0.2
"""Seconds without a translation after which a deflected cap counts as released. A deflected cap repeats its translation
every 16 ms, and a released one sends zeros three times and then nothing (SpaceNavigator; 16 ms on a SpaceMouse
Wireless): so silence at rest is normal, and silence in deflection means that the zeros were lost on the way."""
MOST_REPORTS = 64
"""Taken in one reading; as many as Linux keeps."""
BUTTONS = 32
"""Bits that are kept."""
RANGES = {"speed": (0.1, 1e-4, 1.0), "dead_zone": (0.05, 0.0, 0.9)}
"""Parameters: default, least, most. Full speed [m/s], dead zone as a part of full deflection."""

_AXES = struct.Struct("<3h")


class SpaceMouseState:
    """What the last reports said.

    Attributes:
        translation: Counts in the device's own axes: right, towards the user, down.
        rotation: Counts about the same axes.
        buttons: A bit each.
    """

    __slots__ = ("buttons", "rotation", "translation")

    def __init__(self) -> None:
        self.translation: tuple[int, int, int] = (0, 0, 0)
        self.rotation: tuple[int, int, int] = (0, 0, 0)
        self.buttons = 0

    def take(self, report: bytes) -> bool:
        """Take in a report; whether it held the translation. One that is unknown or too short changes nothing."""
        number, size = (report[0], len(report)) if report else (0, 0)
        if number == 1 and size >= 7:
            self.translation = _AXES.unpack_from(report, 1)
            if size >= 13:
                self.rotation = _AXES.unpack_from(report, 7)
            return True
        if number == 2 and size >= 7:
            self.rotation = _AXES.unpack_from(report, 1)
        elif number == 3 and size >= 2:
            self.buttons = int.from_bytes(report[1 : 1 + BUTTONS // 8], "little")
        return False

    @property
    def deflection(self) -> Vec3:
        """Of the cap, as parts of full deflection: right, up, towards the user."""
        right, near, down = self.translation
        return right / FULL, -down / FULL, near / FULL


class SpaceMouse:
    """A point that a SpaceMouse moves.

    Args:
        wanted: Which one.
        speed: At full deflection [m/s].
        dead_zone: Part of full deflection that counts as none, per axis.
        system: That lists and opens HID devices; None takes the machine's.
    """

    def __init__(
        self,
        wanted: HidWanted,
        speed: float = RANGES["speed"][0],
        dead_zone: float = RANGES["dead_zone"][0],
        system: HidSystem | None = None,
    ):
        self._wanted, self._system = wanted, system
        self.info = DeviceInfo(name=wanted.text, kind="spacemouse", absolute=False)
        self._hand = RateHand(speed, dead_zone)
        self._state = SpaceMouseState()
        self._heard = -math.inf
        self._port: HidPort | None = None
        self._before: HidFound | None = None

    def open(self) -> None:
        """Find it and take it. It rests, with no button held, until it says otherwise.

        Raises:
            InputError: It is not there, in use, or may not be opened.
        """
        self.close()
        self._port = open_hid(self._wanted, self._system or hid_system(), self._before)
        self._before = self._port.found
        self._state = SpaceMouseState()
        self._hand.stop()

    def read(self, time: float) -> DeviceSample:
        """See `Device`. A cap at rest is silent, so every reading of one that is there counts as fresh."""
        port, state = self._port, self._state
        if port is None:
            raise DeviceLost(f"{self.info.name} is not open")
        try:
            for report in waiting_reports(port, MOST_REPORTS):
                if state.take(report):
                    self._heard = time
        except OSError as error:
            self.close()
            raise DeviceLost(error.strerror or str(error)) from None
        deflection = state.deflection if time - self._heard <= SILENCE else ZERO
        return DeviceSample(time, self._hand.move(time, deflection), state.buttons)

    def write(self, force: Vec3) -> None:
        """Ignores the force: there are no motors."""

    def close(self) -> None:
        """See `Device`."""
        port, self._port = self._port, None
        if port is not None:
            port.close()


def create(spec: DeviceSpec, system: HidSystem | None = None) -> SpaceMouse:
    """`spacemouse`, `spacemouse:SERIAL`, `spacemouse:#2`, each with `speed=…` and `dead_zone=…`.

    Raises:
        InputError: Its argument is bad.
    """
    serial, ordinal, numbers, _ = parse_argument(spec, RANGES)
    return SpaceMouse(_wanted(spec.text, serial, ordinal), numbers["speed"], numbers["dead_zone"], system)


def find_devices(system: HidSystem | None = None) -> tuple[str, ...]:
    """One line per SpaceMouse that is plugged in, which begins with the text to ask for it by.

    Raises:
        InputError: A package is needed here, and absent.
    """
    return describe_devices("spacemouse", _wanted("spacemouse"), system or hid_system())


def _wanted(text: str, serial: str | None = None, ordinal: int = 0) -> HidWanted:
    return HidWanted(text=text, what="SpaceMouse", models=MODELS, usage=USAGE, serial=serial, ordinal=ordinal)
