"""The DualSense on bytes that others recorded, and on bytes made to the documented layout.

Recorded by Bluetooth: darthcloud/bt_traces, blueretro_logs, `blueretro_v0.8_ps5_dualsense_inquiry_rumble_0x31.txt` and
`blueretro_v0.7_ps5_dualsense_page.txt`. The documented effect: rafaelvaloto/Dualsense-Multiplatform, wiki, "HEX Mapping
Reference". What comes by USB is made to the layout of the Linux driver.
"""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from otwarp.haptics.devices.dualsense import (
    INPUT_SEED,
    OUTPUT_SEED,
    RANGES,
    Feel,
    checksum,
    decode,
    encode_bluetooth,
    encode_usb,
    trigger_effect,
)

RECORDED = bytes.fromhex(
    "31 31 81 81 80 82 00 00 01 08 00 00 00 BB 2A 8F B5 03 00 08 00 FD FF 37 FF 9A 1C 6C F1 3F 8A A6 00 02 80 00 00 00"
    "80 00 00 00 00 09 09 00 00 00 00 00 32 94 A6 00 04 00 00 AE FD 8B 4A 8A 5C 2E 4D 00 00 00 00 00 00 00 00 00"
    "31 78 3A AF"
)
RECORDED_SIMPLE = bytes.fromhex("01 80 81 80 7E 08 00 3C 00 00")
RECORDED_OUTPUT = bytes.fromhex("31 02 00 04 00 00") + bytes(41) + bytes.fromhex("FF FF") + bytes(25)
"""Lights, sent to a controller that obeyed; without its checksum."""
RECORDED_OUTPUT_CHECKSUM = bytes.fromhex("FE 52 CF D9")
DOCUMENTED_EFFECT = bytes.fromhex("21 fe 03 f8 ff ff 3f")
"""Strongest resistance from the second zone on."""


def usb(x=128, y=128, u=128, v=128, l2=0, r2=0, bits=(8, 0, 0)):
    return bytes([1, x, y, u, v, l2, r2, 77, *bits, 0]).ljust(64, b"\0")


def bluetooth(**fields):
    report = (b"\x31\x41" + usb(**fields)[1:]).ljust(74, b"\0")
    return report + checksum(INPUT_SEED, report)


# decoding


def test_a_recorded_bluetooth_report_is_a_controller_at_rest():
    said = decode(RECORDED, True)
    assert said is not None
    assert max(map(abs, (*said.left, *said.right))) < RANGES["dead_zone"][0] / 2
    assert (said.pull, said.buttons) == ((0.0, 0.0), 0)


def test_one_wrong_byte_makes_a_report_by_bluetooth_unsound():
    for at in range(len(RECORDED)):
        wrong = bytearray(RECORDED)
        wrong[at] ^= 0x10
        assert decode(bytes(wrong), True) is None
    assert checksum(OUTPUT_SEED, RECORDED[:-4]) != RECORDED[-4:]


def test_the_checksum_of_a_recorded_output_report_is_ours():
    assert checksum(OUTPUT_SEED, RECORDED_OUTPUT) == RECORDED_OUTPUT_CHECKSUM


def test_a_recorded_simple_report_whose_counter_is_no_button():
    said = decode(RECORDED_SIMPLE, True)
    assert said is not None
    assert said.left == pytest.approx((0.5 / 127.5, 1.5 / 127.5))
    assert said.right == pytest.approx((0.5 / 127.5, -1.5 / 127.5))
    assert said.buttons == 0
    assert decode(RECORDED_SIMPLE.ljust(78, b"\0"), True) == said  # as Windows fills it up


BITS = {
    0: (8, 0x01, 0),
    1: (8, 0x02, 0),
    2: (0x28, 0, 0),
    3: (0x48, 0, 0),
    4: (0x18, 0, 0),
    5: (0x88, 0, 0),
    6: (0, 0, 0),
    7: (2, 0, 0),
    8: (4, 0, 0),
    9: (6, 0, 0),
    10: (8, 0x10, 0),
    11: (8, 0x20, 0),
    12: (8, 0x40, 0),
    13: (8, 0x80, 0),
    14: (8, 0, 0x01),
    15: (8, 0, 0x02),
    16: (8, 0, 0x04),
}
"""Our bit and the three bytes of the controller: masks of the Linux driver, the hat clockwise from up."""


@pytest.mark.parametrize("bit", BITS)
def test_each_button_has_its_bit_by_usb_and_bluetooth(bit):
    for report, link in ((usb(bits=BITS[bit]), False), (bluetooth(bits=BITS[bit]), True)):
        said = decode(report, link)
        assert said is not None
        assert said.buttons == 1 << bit


def test_the_hat_between_two_directions_is_both():
    up_right = decode(usb(bits=(1, 0, 0)), False)
    assert up_right is not None
    assert up_right.buttons == 1 << 6 | 1 << 7


@given(report=st.binary(max_size=100), link=st.booleans())
def test_what_has_not_the_size_and_number_of_a_report_is_none(report, link):
    said = decode(report, link)
    if said is not None:
        assert (len(report), report[0]) in ({(78, 0x31), (10, 1), (78, 1)} if link else {(64, 1)})
    assert decode(usb()[:63], False) is None
    assert decode(b"\x02" + usb()[1:], False) is None


# encoding


def test_the_documented_effect_is_laid_out_as_ours():
    mode, zones, forces = struct.unpack("<BHI", DOCUMENTED_EFFECT)
    assert (mode, zones) == (0x21, 0b1111111110)
    assert [forces >> 3 * zone & 7 for zone in range(10)] == [0] + 9 * [7]
    for strength in range(1, 9):
        effect = trigger_effect(strength)
        assert len(effect) == 11
        mode, zones, forces = struct.unpack("<BHI4x", effect)
        assert (mode, zones) == (0x21, 0x3FF)
        assert [forces >> 3 * zone & 7 for zone in range(10)] == 10 * [strength - 1]
    assert trigger_effect(0) == b"\x05".ljust(11, b"\0")


def test_an_output_report_by_usb():
    effect = trigger_effect(3)
    report = encode_usb(Feel(200, 3))
    assert len(report) == 48
    assert report[:5] == bytes([0x02, 0x0F, 0x00, 200, 200])
    assert (report[11:22], report[22:33]) == (effect, effect)
    assert not any(report[5:11] + report[33:])  # no sound, no light


def test_an_output_report_by_bluetooth_is_numbered_and_sealed():
    for sequence in (0, 1, 15, 16, 33):
        report = encode_bluetooth(Feel(7, 8), sequence)
        assert len(report) == 78
        assert report[:3] == bytes([0x31, sequence % 16 << 4, 0x10])
        assert report[3:50] == encode_usb(Feel(7, 8))[1:]
        assert report[-4:] == checksum(OUTPUT_SEED, report[:-4])
