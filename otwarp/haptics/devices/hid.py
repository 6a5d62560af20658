"""What HID devices have in common: finding and opening them, their arguments, and a place out of a deflection."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, Vec3
from otwarp.haptics.devices import DeviceSpec, parse_number, parse_parameters

RULES = "/etc/udev/rules.d/70-otwarp-hid.rules"
"""Where the rule goes that lets the user at the desk open a device; it must sort before 73-seat-late.rules."""
LONGEST_STEP = 0.1
"""Seconds of movement that one reading may catch up: a loop that was stopped must not make the hand leap."""
BELOW = 1.0 - 1e-12
"""Shortens a step at full deflection, so that rounding leaves it within the full speed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HidFound:
    """A HID device, or one interface of one, as the system lists it.

    Attributes:
        path: To open it by.
        vendor, product: USB or Bluetooth identifiers.
        serial: As the device says, or empty; the address of a Bluetooth device.
        place: The socket or radio where it is; empty where the system does not say.
        name: As the device says.
        usages: (page, usage) of its top-level collections; empty where the system does not say.
        bluetooth: Whether it is connected by Bluetooth.
        allowed: Whether this user may open it, as far as is known.
    """

    path: str
    vendor: int
    product: int
    serial: str = ""
    place: str = ""
    name: str = ""
    usages: tuple[tuple[int, int], ...] = ()
    bluetooth: bool = False
    allowed: bool = True

    @property
    def rule(self) -> str:
        """The udev rule that allows it, for USB and Bluetooth alike."""
        return f'KERNEL=="hidraw*", KERNELS=="*:{self.vendor:04X}:{self.product:04X}.*", TAG+="uaccess"'


class HidPort(Protocol):
    """An open HID device; any method raises OSError when it is gone."""

    @property
    def found(self) -> HidFound:
        """The device that was opened."""
        ...

    def read(self) -> bytes:
        """The next report with its number first, empty if none is waiting; never blocks."""
        ...

    def write(self, report: bytes) -> None:
        """Send an output report, its number first; may wait for the transfer."""
        ...

    def feature(self, number: int, size: int) -> bytes:
        """Ask for a feature report; waits for the answer."""
        ...

    def close(self) -> None:
        """Let go of it; may be called more than once."""
        ...


class HidSystem(Protocol):
    """What lists and opens HID devices."""

    def devices(self) -> Sequence[HidFound]:
        """All HID devices that the system lists."""
        ...

    def open(self, found: HidFound) -> HidPort:
        """Open one.

        Raises:
            PermissionError: This user may not.
            BlockingIOError: Another side, or another otwarp, has it.
            OSError: It cannot be opened otherwise.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class HidWanted:
    """Which device is asked for.

    Attributes:
        text: As typed, for messages.
        what: What it is called, for messages.
        models: Names by (vendor, product).
        usage: (page, usage) of the interface that is meant: a receiver has several.
        serial: Of the one that is meant, or None.
        ordinal: Which of those that are found, from 0, if there is no serial.
    """

    text: str
    what: str
    models: Mapping[tuple[int, int], str]
    usage: tuple[int, int]
    serial: str | None = None
    ordinal: int = 0


def matching(wanted: HidWanted, system: HidSystem) -> list[HidFound]:
    """The devices of the wanted models, ordered by path, without interfaces of another use."""
    return [
        found
        for found in system.devices()
        if (found.vendor, found.product) in wanted.models and (not found.usages or wanted.usage in found.usages)
    ]


def open_hid(wanted: HidWanted, system: HidSystem, before: HidFound | None = None) -> HidPort:
    """Open the device that is wanted.

    Args:
        wanted: Which.
        system: That lists and opens.
        before: What was opened before in its stead. The same is sought again, by serial, or by its socket if it has
            none: with two of a kind unplugged, the hands must not come back exchanged.

    Raises:
        InputError: It is not there, is in use, or may not be opened; one line.
    """
    where, here = f"device {wanted.text!r}", matching(wanted, system)
    known = before is not None and (before.serial or before.place)
    found = _again(where, wanted, here, before) if before and known else _chosen(where, wanted, here)
    try:
        return system.open(found)
    except PermissionError:
        raise InputError(
            f"{where}: {found.path} may not be opened by this user; put the udev rule {found.rule} into {RULES} "
            "and plug it in again"
        ) from None
    except BlockingIOError:
        raise InputError(f"{where}: {found.path} is in use already; each hand must have its own") from None
    except OSError as error:
        raise InputError(f"{where}: {found.path} cannot be opened ({error.strerror or error})") from None


def _again(where: str, wanted: HidWanted, here: Sequence[HidFound], before: HidFound) -> HidFound:
    """The one that was open before."""
    for found in here:
        if found.serial == before.serial if before.serial else found.place == before.place:
            return found
    must = f"serial {before.serial}" if before.serial else f"without serial, so it must come back to {before.place}"
    raise InputError(f"{where}: {wanted.what} is not plugged in again ({must})")


def _chosen(where: str, wanted: HidWanted, here: Sequence[HidFound]) -> HidFound:
    """The first that fits, or a line that says what is there instead."""
    if not here:
        raise InputError(f"{where}: no {wanted.what} is plugged in")
    if wanted.serial is not None:
        for found in here:
            if found.serial.lower() == wanted.serial.lower():
                return found
        there = ", ".join(found.serial or f"one without serial (#{i})" for i, found in enumerate(here, 1))
        raise InputError(f"{where}: no {wanted.what} has serial {wanted.serial!r}; must be one of: {there}")
    if wanted.ordinal >= len(here):
        raise InputError(f"{where}: is {wanted.what} #{wanted.ordinal + 1}, but only {len(here)} is plugged in")
    return here[wanted.ordinal]


def waiting_reports(port: HidPort, most: int) -> Iterator[bytes]:
    """The reports that wait, oldest first, no more than `most`: a device must not keep a loop busy."""
    for _ in range(most):
        report = port.read()
        if not report:
            return
        yield report


def describe_devices(kind: str, wanted: HidWanted, system: HidSystem) -> tuple[str, ...]:
    """One line per device that is plugged in: the text to ask for it by, and what it is."""
    lines = []
    for number, found in enumerate(matching(wanted, system), 1):
        model = wanted.models[found.vendor, found.product]
        link = "Bluetooth" if found.bluetooth else "USB"
        text = f"{kind}:{found.serial or f'#{number}'}"
        line = f"{text}  {model} ({found.vendor:04x}:{found.product:04x}, {link}, {found.path})"
        lines.append(line if found.allowed else f"{line}; may not be opened, needs the udev rule {found.rule}")
    return tuple(lines)


def parse_argument(
    spec: DeviceSpec, ranges: Mapping[str, tuple[float, float, float]], words: Mapping[str, Sequence[str]] | None = None
) -> tuple[str | None, int, dict[str, float], dict[str, str]]:
    """`SERIAL,key=value,…`, `#2,key=value,…` or `key=value,…` as (serial, ordinal, numbers, words).

    Args:
        spec: As typed.
        ranges: Default, least and most of each number.
        words: Choices of each word, the default first.

    Raises:
        InputError: An unknown key, a value out of range, an ordinal that is none.
    """
    where, text = f"device {spec.text!r}", spec.argument or ""
    words = words or {}
    if "=" in text.split(",")[0]:
        text = f",{text}"  # parameters without a serial before them
    which, given = parse_parameters(where, text, (*ranges, *words))
    numbers = {key: parse_number(where, key, given.get(key), *limits) for key, limits in ranges.items()}
    chosen = {key: given.get(key, choices[0]) for key, choices in words.items()}
    for key, word in chosen.items():
        if word not in words[key]:
            raise InputError(f"{where}: {key} = {word!r} must be one of {', '.join(words[key])}")
    if not which.startswith("#"):
        return which or None, spec.ordinal, numbers, chosen
    if not (which[1:].isascii() and which[1:].isdigit() and len(which) <= 3) or not 1 <= int(which[1:]) <= 99:
        raise InputError(f"{where}: {which!r} must be # and a number from 1 to 99")
    return None, int(which[1:]) - 1, numbers, chosen


class RateHand:
    """The place of a hand whose velocity is a deflection.

    v = speed·s, s_i = sign(d_i)·(|d_i| − z)/(1 − z) beyond the dead zone z and 0 within, d clamped to ±1, and |s| to 1.
    The deflection is held from one reading to the next.

    Args:
        speed: At full deflection, in any direction [m/s].
        dead_zone: Part of the full deflection, per axis, that counts as none.

    Attributes:
        position: Since it was made [m].
    """

    __slots__ = ("_dead_zone", "_gain", "_speed", "_time", "_velocity", "position")

    def __init__(self, speed: float, dead_zone: float):
        self._speed, self._dead_zone, self._gain = speed, dead_zone, 1.0 / (1.0 - dead_zone)
        self._time = -math.inf
        self._velocity: Vec3 = ZERO
        self.position: Vec3 = ZERO

    def stop(self) -> None:
        """Stand still until the next deflection, however long that takes."""
        self._time, self._velocity = -math.inf, ZERO

    def move(self, time: float, deflection: Vec3) -> Vec3:
        """The place at `time` [s] on the way so far; from then on the deflection (parts of full, ±1) moves it."""
        elapsed = time - self._time
        if 0.0 < elapsed < math.inf:
            elapsed = elapsed if elapsed < LONGEST_STEP else LONGEST_STEP
            (x, y, z), (u, v, w) = self.position, self._velocity
            self.position = (x + u * elapsed, y + v * elapsed, z + w * elapsed)
        self._time = time
        self._velocity = self._shaped(*deflection)
        return self.position

    def _shaped(self, x: float, y: float, z: float) -> Vec3:
        """Velocity [m/s] of a deflection."""
        x, y, z = self._beyond(x), self._beyond(y), self._beyond(z)
        square = x * x + y * y + z * z
        k = self._speed * BELOW
        if square > 1.0:
            k /= math.sqrt(square)
        return k * x, k * y, k * z

    def _beyond(self, d: float) -> float:
        """What of a deflection lies beyond the dead zone, of what can."""
        size = abs(d)
        if size <= self._dead_zone:
            return 0.0
        beyond = (min(size, 1.0) - self._dead_zone) * self._gain
        return beyond if d > 0.0 else -beyond
