"""What a DualSense and its host say to each other: bytes of input and output reports.

Layouts after the Linux driver (drivers/hid/hid-playstation.c: `dualsense_input_report`, `dualsense_output_report_*`)
and, for what that leaves reserved, dualsensectl and the trigger effects documented by J. Klein (Nielk1); see
docs/haptics_devices_hid.md. By Bluetooth a report ends in the CRC-32 of a seed byte and all before it.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

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
HALF = 127.5
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
    x, y, u, v = ((b - CENTRE) / HALF for b in sticks)
    face, shoulder, rest = bits
    hat = face & 0x0F
    buttons = shoulder & 0x03
    buttons |= (face & 0x20) >> 3 | (face & 0x40) >> 3 | (face & 0x10) | (face & 0x80) >> 2
    buttons |= (HAT[hat] if hat < len(HAT) else 0) << 6
    buttons |= (shoulder & 0xF0) << 6
    buttons |= (rest & 0x07) << 14
    return Pad((x, y), (u, v), (pull[0] / 255.0, pull[1] / 255.0), buttons)


def encode_usb(feel: Feel) -> bytes:
    """The output report by USB."""
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
