"""A Sony DualSense: a stick and the triggers are the hand's velocity; rumble and stiff triggers stand in for force.

It cannot push. The size of the force, as a part of `force`, shakes both motors and stiffens both
triggers; its direction is lost. `DeviceInfo.force` is therefore no force of the device but the one that is rendered as
the strongest effect.

Reports are laid out as in the Linux driver (drivers/hid/hid-playstation.c: `dualsense_input_report`,
`dualsense_output_report_*`) and, for what that leaves reserved, in dualsensectl and the trigger effects documented by
J. Klein (Nielk1); see docs/haptics_devices_hid.md. By Bluetooth a report ends in the CRC-32 of a seed byte and all
before it.

The binding never met a DualSense. Its decoder and checksums are tested on bytes that others recorded by Bluetooth, and
on bytes made to the documented layout; what it sends was never felt.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from otwarp.haptics.core import ZERO, DeviceInfo, DeviceLost, DeviceSample, Vec3
from otwarp.haptics.devices import DeviceSpec
from otwarp.haptics.devices.exchange import LatestSender
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
from otwarp.haptics.devices.hid_ports import address_of, found_at, hid_system, open_beside

MODELS = {(0x054C, 0x0CE6): "DualSense", (0x054C, 0x0DF2): "DualSense Edge"}
"""By (vendor, product); those that the Linux driver calls PS5 controllers."""
USAGE = (0x01, 0x05)
"""Generic Desktop, Game Pad."""
SILENCE = 0.1
"""Seconds without a report after which sticks and buttons count as released: it reports all the time, every 4 ms by
USB."""
MOST_REPORTS = 64
"""Taken in one reading; as many as Linux keeps."""
USB_RATE, BLUETOOTH_RATE = 100.0, 30.0
"""Most output reports per second. By Bluetooth they share the air with what the controller says."""
REFRESH = 0.5
"""Seconds after which an effect that stays is sent again: a motor may time out, and a report may be lost."""

RANGES = {
    "speed": (0.1, 1e-4, 1.0),
    "dead_zone": (0.1, 0.0, 0.9),
    "force": (3.3, 0.01, 100.0),
    "rumble": (1.0, 0.0, 1.0),
    "triggers": (1.0, 0.0, 1.0),
}
"""Parameters: default, least, most. Full speed [m/s], dead zone as a part of full deflection, force of the strongest
effect [N] (that of a Touch), and how much of their range motors and triggers use. Sticks were recorded at rest within
3 % of the middle."""
WORDS = {"stick": ("left", "right")}

USB_INPUT, USB_INPUT_SIZE = 0x01, 64
BLUETOOTH_INPUT, BLUETOOTH_INPUT_SIZE = 0x31, 78
SIMPLE_INPUT, SIMPLE_INPUT_SIZE = 0x01, 10
"""By Bluetooth until the host has asked for the calibration: without motion sensors, and without a checksum."""
CALIBRATION, CALIBRATION_SIZE = 0x05, 41
USB_OUTPUT = 0x02
BLUETOOTH_OUTPUT, BLUETOOTH_OUTPUT_SIZE = 0x31, 78
OUTPUT_TAG = 0x10
INPUT_SEED, OUTPUT_SEED = b"\xa1", b"\xa2"
"""Of the checksum: the transaction header of HID by Bluetooth, which is sent before the report."""

CENTRE = 127.5
"""A stick goes from 0 to 255."""
HAT = (0b0001, 0b0011, 0b0010, 0b0110, 0b0100, 0b1100, 0b1000, 0b1001)
"""Directions of the pad as bits up, right, down, left; 8 and above is none."""

RUMBLE = 0x01 | 0x02
"""Of the first byte of flags: rumble as of old, instead of sound through the actuators."""
TRIGGERS = 0x04 | 0x08
EFFECT_OFF, EFFECT_FEEDBACK = 0x05, 0x21
ALL_ZONES = 0x3FF
"""Ten parts of a trigger's way, a bit each."""
EVERY_ZONE = 0o1111111111
"""One in each of ten fields of three bits."""
STRONGEST = 8
"""Strength of a trigger's resistance; 0 is none."""

_COMMON = struct.Struct("<BBBB6x11s11s15x")
"""47 bytes: two of flags, right and left motor, sound, right and left trigger, lights."""


@dataclass(frozen=True, slots=True)
class Pad:
    """What a report says.

    Attributes:
        left, right: Stick: right and towards the user, ±1.
        pull: Left and right trigger, 0 to 1.
        buttons: Bits: L1, R1, cross, circle, square, triangle, pad up, right, down, left, create, options, L3, R3, PS,
            touch pad, mute.
    """

    left: tuple[float, float]
    right: tuple[float, float]
    pull: tuple[float, float]
    buttons: int


@dataclass(frozen=True, slots=True)
class Feel:
    """What it is to do.

    Attributes:
        rumble: Of both motors, 0 to 255.
        resistance: Of both triggers, 0 to 8.
    """

    rumble: int = 0
    resistance: int = 0


OFF = Feel()


def decode(report: bytes, bluetooth: bool) -> Pad | None:
    """What an input report says; None for one of another number or size, or with a wrong checksum."""
    number, size = (report[0], len(report)) if report else (0, 0)
    if not bluetooth:
        return _full(report, 1) if number == USB_INPUT and size == USB_INPUT_SIZE else None
    if number == BLUETOOTH_INPUT and size == BLUETOOTH_INPUT_SIZE:
        return _full(report, 2) if checksum(INPUT_SEED, report[:-4]) == report[-4:] else None
    # Windows fills it up to the size of the longest
    if number == SIMPLE_INPUT and size in (SIMPLE_INPUT_SIZE, BLUETOOTH_INPUT_SIZE):
        x, y, u, v, first, second, third, pull, push = report[1:10]
        return _pad((x, y, u, v), (pull, push), (first, second, third & 0x03))
    return None


def checksum(seed: bytes, report: bytes) -> bytes:
    """CRC-32 (IEEE 802.3) of the seed and the report, as its last four bytes."""
    return zlib.crc32(report, zlib.crc32(seed)).to_bytes(4, "little")


def _full(report: bytes, at: int) -> Pad:
    x, y, u, v, pull, push, _, first, second, third = report[at : at + 10]
    return _pad((x, y, u, v), (pull, push), (first, second, third))


def _pad(sticks: tuple[int, int, int, int], pull: tuple[int, int], bits: tuple[int, int, int]) -> Pad:
    """From bytes as they come: sticks right and down, hat and face buttons, shoulders, the rest."""
    x, y, u, v = ((b - CENTRE) / CENTRE for b in sticks)
    face, shoulder, rest = bits
    hat = face & 0x0F
    buttons = shoulder & 0x03
    buttons |= (face & 0x20) >> 3 | (face & 0x40) >> 3 | (face & 0x10) | (face & 0x80) >> 2
    buttons |= (HAT[hat] if hat < len(HAT) else 0) << 6
    buttons |= (shoulder & 0xF0) << 6
    buttons |= (rest & 0x07) << 14
    return Pad((x, y), (u, v), (pull[0] / 255.0, pull[1] / 255.0), buttons)


def encode_usb(feel: Feel) -> bytes:
    """The output report by USB: its number, then what to do."""
    return bytes((USB_OUTPUT,)) + _common(feel)


def encode_bluetooth(feel: Feel, sequence: int) -> bytes:
    """The output report by Bluetooth.

    Args:
        feel: What to do.
        sequence: Counts reports; its lowest four bits are sent.
    """
    head = bytes((BLUETOOTH_OUTPUT, (sequence & 0x0F) << 4, OUTPUT_TAG))
    report = (head + _common(feel)).ljust(BLUETOOTH_OUTPUT_SIZE - 4, b"\0")
    return report + checksum(OUTPUT_SEED, report)


def _common(feel: Feel) -> bytes:
    """The 47 bytes that both links carry."""
    effect = trigger_effect(feel.resistance)
    return _COMMON.pack(RUMBLE | TRIGGERS, 0, feel.rumble, feel.rumble, effect, effect)


def trigger_effect(resistance: int) -> bytes:
    """A resistance of a strength from 0 to 8 along all of a trigger's way; 11 bytes.

    Mode, a bit per zone (16 bits), three bits of strength − 1 per zone (32 bits).
    """
    if resistance <= 0:
        return bytes((EFFECT_OFF,)).ljust(11, b"\0")
    strength = min(resistance, STRONGEST) - 1
    return struct.pack("<BHI4x", EFFECT_FEEDBACK, ALL_ZONES, strength * EVERY_ZONE)


class DualSense:
    """A point that a DualSense moves.

    Right, left, towards and away from the user by the stick; up by R2, down by L2.

    Args:
        wanted: Which one.
        numbers: By name, see `RANGES`; what is missing has its default.
        stick: `left` or `right`.
        system: That lists and opens HID devices; None takes the machine's.
        sender: Makes what sends effects: a thread, because a transfer waits.
    """

    def __init__(
        self,
        wanted: HidWanted,
        numbers: dict[str, float] | None = None,
        stick: str = "left",
        system: HidSystem | None = None,
        sender: Callable[[Callable[[Feel], None], Callable[[], None]], LatestSender[Feel]] = LatestSender,
    ):
        given = {key: default for key, (default, _, _) in RANGES.items()} | (numbers or {})
        self._wanted, self._system, self._make_sender = wanted, system, sender
        self._stick_is_left = stick == "left"
        self._full = given["force"]
        self._motors, self._triggers = 255.0 * given["rumble"], STRONGEST * given["triggers"]
        self.info = DeviceInfo(
            name=wanted.text,
            kind="dualsense",
            force=self._full,
            continuous_force=self._full,
            absolute=False,
        )
        self._hand = RateHand(given["speed"], given["dead_zone"])
        self._port: HidPort | None = None
        self._sender: LatestSender[Feel] | None = None
        self._before: HidFound | None = None
        self.address = ""
        self._rest()

    def _rest(self) -> None:
        """Nothing is pushed, held or felt."""
        self._deflection: Vec3 = ZERO
        self._buttons = 0
        self._heard = self._sent_at = -math.inf
        self._time = 0.0
        self._sent: Feel | None = None
        self._period = 1.0 / USB_RATE

    def open(self) -> None:
        """Find it, take it, and by Bluetooth ask it for its full reports.

        Raises:
            InputError: It is not there, in use, or may not be opened.
        """
        self.close()
        port = open_hid(self._wanted, self._system or hid_system(), self._before)
        self._rest()
        self._hand.stop()
        if port.found.bluetooth:
            self._period = 1.0 / BLUETOOTH_RATE
            with suppress(OSError):  # its simple reports will do
                port.feature(CALIBRATION, CALIBRATION_SIZE)
        self._port, self._before, self.address = port, port.found, address_of(port.found)
        self._sender = self._make_sender(_sending(port), port.close)

    def read(self, time: float) -> DeviceSample:
        """See `Device`."""
        port = self._port
        if port is None:
            raise DeviceLost(f"{self.info.name} is not open")
        fresh = False
        try:
            for report in waiting_reports(port, MOST_REPORTS):
                pad = decode(report, port.found.bluetooth)
                if pad is not None:
                    x, z = pad.left if self._stick_is_left else pad.right
                    down, up = pad.pull
                    self._deflection, self._buttons, fresh = (x, up - down, z), pad.buttons, True
        except OSError as error:
            raise self._lost(error) from None
        self._time = time
        if fresh:
            self._heard = time
        elif time - self._heard > SILENCE:
            self._deflection, self._buttons = ZERO, 0
        return DeviceSample(time, self._hand.move(time, self._deflection), self._buttons, fresh)

    def write(self, force: Vec3) -> None:
        """Render the size of a force [N]; handed to the sender at most at the link's rate, and never waits.

        Raises:
            DeviceLost: It is not open, or an earlier effect could not be sent.
        """
        sender = self._sender
        if sender is None:
            raise DeviceLost(f"{self.info.name} is not open")
        since = self._time - self._sent_at
        if since < self._period:
            return
        feel = self._felt(force)
        if feel == self._sent and (feel == OFF or since < REFRESH):
            return
        try:
            sender.put(feel)
        except OSError as error:
            raise self._lost(error) from None
        self._sent, self._sent_at = feel, self._time

    def _felt(self, force: Vec3) -> Feel:
        """The effect of a force; none for one that is not finite."""
        level = math.hypot(*force) / self._full
        if not level < math.inf:
            return OFF
        level = min(level, 1.0)
        return Feel(round(self._motors * level), round(self._triggers * level))

    def _lost(self, error: OSError) -> DeviceLost:
        self.close(wait=False)  # the loop of the other device must not wait for one that hangs
        return DeviceLost(error.strerror or str(error))

    def close(self, wait: bool = True) -> None:
        """See `Device`; motors off, triggers loose. The sender closes the port after the last report."""
        sender, self._sender, self._port = self._sender, None, None
        if sender is not None:
            sender.close(OFF, wait)


def _sending(port: HidPort) -> Callable[[Feel], None]:
    """What writes effects to a port as its link wants them."""
    if not port.found.bluetooth:
        return lambda feel: port.write(encode_usb(feel))
    sequence = 0

    def send(feel: Feel) -> None:
        """Write one, numbered."""
        nonlocal sequence
        port.write(encode_bluetooth(feel, sequence))
        sequence += 1

    return send


def create(spec: DeviceSpec, system: HidSystem | None = None) -> DualSense:
    """`dualsense`, `dualsense:SERIAL`, `dualsense:#2`, each with the parameters of `RANGES` and `stick=right`.

    Raises:
        InputError: Its argument is bad.
    """
    serial, ordinal, numbers, words = parse_argument(spec, RANGES, WORDS)
    return DualSense(_wanted(spec.text, serial, ordinal), numbers, words["stick"], system)


class ZeroEffect:
    """Motors off and triggers loose, beside the servo that holds the device; see `core.ZeroForce`.

    Args:
        found: The device.
        open_port: Opens it.

    Raises:
        OSError: It cannot be opened.
    """

    def __init__(self, found: HidFound, open_port: Callable[[HidFound], HidPort] = open_beside):
        self._found, self._open = found, open_port
        open_port(found).close()  # one that may not be opened is reported before it matters

    def send(self) -> None:
        """See `ZeroForce`; opened anew, for the device may have been plugged in again meanwhile."""
        port = self._open(self._found)
        try:
            _sending(port)(OFF)
        finally:
            port.close()

    def close(self) -> None:
        """See `ZeroForce`: `send` has closed what it opened."""


def zero_force(address: str) -> ZeroEffect:
    """What the guardian sends; a controller keeps its last effect when nobody writes."""
    return ZeroEffect(found_at(address))


def find_devices(system: HidSystem | None = None) -> tuple[str, ...]:
    """One line per DualSense that is plugged in or connected, which begins with the text to ask for it by.

    Raises:
        InputError: A package is needed here, and absent.
    """
    return describe_devices("dualsense", _wanted("dualsense"), system or hid_system())


def _wanted(text: str, serial: str | None = None, ordinal: int = 0) -> HidWanted:
    return HidWanted(text=text, what="DualSense", models=MODELS, usage=USAGE, serial=serial, ordinal=ordinal)
