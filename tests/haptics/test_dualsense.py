"""The DualSense on bytes that others recorded, and on bytes made to the documented layout.

Recorded by Bluetooth: darthcloud/bt_traces, blueretro_logs, `blueretro_v0.8_ps5_dualsense_inquiry_rumble_0x31.txt` and
`blueretro_v0.7_ps5_dualsense_page.txt`. The documented effect: rafaelvaloto/Dualsense-Multiplatform, wiki, "HEX Mapping
Reference". What comes by USB is made to the layout of the Linux driver.
"""

from __future__ import annotations

import math
import struct
import threading
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.devices import parse_devices
from otwarp.haptics.devices.dualsense import (
    BLUETOOTH_RATE,
    OFF,
    RANGES,
    REFRESH,
    SILENCE,
    USB_RATE,
    DualSense,
    create,
    find_devices,
)
from otwarp.haptics.devices.dualsense_report import (
    INPUT_SEED,
    OUTPUT_SEED,
    Feel,
    checksum,
    decode,
    encode_bluetooth,
    encode_usb,
    trigger_effect,
)
from otwarp.haptics.devices.hid_port import HidFound, HidWanted
from otwarp.haptics.devices.rate import LONGEST_STEP
from otwarp.haptics.servo import REOPEN_AFTER
from otwarp.haptics.types import ZERO, Device, DeviceLost, TrapNow
from tests.haptics.hid_double import AtOnce, Plugged, System
from tests.haptics.setups import POWER, hand_config, make_chain
from tests.haptics.test_servo import Rig

PERIOD = 1e-3
ROUNDING = 1e-9
"""Relative, and in metres: sums of a thousand steps in double precision are good to 1e-13."""
DUST = 1e-14
"""Metres: what rounding of places of up to 10 m leaves of a step."""
SPEED, FORCE = RANGES["speed"][0], RANGES["force"][0]

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


def pad(bluetooth=False, number=0, serial="aa:bb:cc:dd:ee:ff", product=0x0CE6):
    return Plugged(
        HidFound(
            path=f"/dev/hidraw{number}",
            vendor=0x054C,
            product=product,
            serial=serial,
            place="usb-0000:00:14.0-1/input3",
            usages=((1, 5),),
            bluetooth=bluetooth,
        )
    )


def usb(x=128, y=128, u=128, v=128, l2=0, r2=0, bits=(8, 0, 0)):
    return bytes([1, x, y, u, v, l2, r2, 77, *bits, 0]).ljust(64, b"\0")


def bluetooth(**fields):
    report = (b"\x31\x41" + usb(**fields)[1:]).ljust(74, b"\0")
    return report + checksum(INPUT_SEED, report)


def opened(device=None, text="dualsense", sender=AtOnce):
    device = device or pad()
    (spec,) = parse_devices([text])
    hand = create(spec, System(device))
    hand._make_sender = sender
    hand.open()
    return hand, device


def written(device):
    """What a controller was told, as (right motor, left motor, right effect, left effect)."""
    at = 3 if device.found.bluetooth else 1
    return [(r[at + 2], r[at + 3], r[at + 10 : at + 21], r[at + 21 : at + 32]) for r in device.written]


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


# motion


@pytest.mark.parametrize(
    ("text", "fields", "way"),
    [
        ("dualsense", {"x": 255}, (1, 0, 0)),
        ("dualsense", {"x": 0}, (-1, 0, 0)),
        ("dualsense", {"y": 255}, (0, 0, 1)),
        ("dualsense", {"y": 0}, (0, 0, -1)),
        ("dualsense", {"r2": 255}, (0, 1, 0)),
        ("dualsense", {"l2": 255}, (0, -1, 0)),
        ("dualsense", {"l2": 255, "r2": 255}, (0, 0, 0)),
        ("dualsense", {"u": 255, "v": 0}, (0, 0, 0)),
        ("dualsense:stick=right", {"u": 255}, (1, 0, 0)),
        ("dualsense:stick=right", {"v": 0}, (0, 0, -1)),
    ],
)
def test_stick_and_triggers_move_the_hand(text, fields, way):
    for device, report in ((pad(), usb(**fields)), (pad(True), bluetooth(**fields))):
        hand, device = opened(device, text)
        for n in range(1001):
            if n % 4 == 0:
                device.reports.append(report)
            sample = hand.read(n * PERIOD)
            assert sample.fresh == (n % 4 == 0)
        assert sample.position == pytest.approx(tuple(SPEED * w for w in way), abs=ROUNDING)


def test_silence_releases_sticks_and_buttons():
    hand, device = opened()
    device.reports.append(usb(x=255, bits=(8, 0x03, 0)))
    samples = [hand.read(n * PERIOD) for n in range(1000)]
    assert samples[0].buttons == samples[50].buttons == 3
    assert samples[-1].buttons == 0
    assert samples[-1].position[0] == pytest.approx(SPEED * SILENCE, abs=2 * SPEED * PERIOD)
    assert not samples[-1].fresh


@given(
    steps=st.lists(
        st.tuples(
            st.floats(-1.0, 5.0),
            st.one_of(
                st.binary(max_size=100),
                st.binary(min_size=63, max_size=63).map(lambda rest: b"\x01" + rest),
                st.binary(min_size=73, max_size=73).map(
                    lambda rest: b"\x31" + rest + checksum(INPUT_SEED, b"\x31" + rest)
                ),
            ),
            st.tuples(*[st.floats()] * 3),
        ),
        max_size=30,
    ),
    link=st.booleans(),
)
@settings(max_examples=200, deadline=None)
def test_no_bytes_and_no_force_raise_leap_or_leave_the_numbers(steps, link):
    hand, device = opened(pad(link))
    time, before = 0.0, hand.read(0.0).position
    for elapsed, said, force in steps:
        time, elapsed = time + elapsed, (time + elapsed) - time
        device.reports.append(said)
        sample = hand.read(time)
        hand.write(force)
        assert (
            math.dist(sample.position, before) <= SPEED * min(max(elapsed, 0.0), LONGEST_STEP) * (1 + ROUNDING) + DUST
        )
        assert all(map(math.isfinite, sample.position))
        assert 0 <= sample.buttons < 1 << 17
        before = sample.position
    for right, left, *effects in written(device):
        assert right == left
        assert all(effect[0] in (0x05, 0x21) for effect in effects)


def test_by_bluetooth_it_is_asked_for_its_full_reports_and_does_without():
    for refuses in (False, True):
        device = pad(True)
        device.no_features = refuses
        hand, device = opened(device)
        assert device.port is not None
        assert device.port.features == [(0x05, 41)]
        device.reports.append(RECORDED_SIMPLE)
        assert hand.read(0.0).fresh
    hand, device = opened(pad(False))
    assert device.port is not None
    assert device.port.features == []


# what stands in for force


def test_effects_are_in_proportion_to_the_size_of_the_force():
    hand, device = opened(text="dualsense:force=2")
    assert (hand.info.force, hand.info.continuous_force, hand.info.met_hardware) == (2.0, 2.0, False)
    forces = [(0.0, 0.0, 0.0), (0.0, -0.5, 0.0), (0.6, 0.0, -0.8), (0.0, 2.0, 0.0), (9.0, 9.0, 9.0)]
    for n, force in enumerate(forces):
        hand.read(n * 0.02)
        hand.write(force)
    expected = [(0, 0), (64, 2), (128, 4), (255, 8)]  # the fifth is felt as the fourth
    assert written(device) == [(m, m, trigger_effect(s), trigger_effect(s)) for m, s in expected]


def test_motors_and_triggers_may_be_turned_down_and_off():
    hand, device = opened(text="dualsense:rumble=0.5,triggers=0")
    hand.read(0.0)
    hand.write((FORCE, 0.0, 0.0))
    assert written(device) == [(128, 128, trigger_effect(0), trigger_effect(0))]


@pytest.mark.parametrize("force", [(math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0), (0.0, -math.inf, math.nan)])
def test_a_force_that_is_not_finite_is_none(force):
    hand, device = opened()
    hand.read(0.0)
    hand.write(force)
    assert written(device)[-1] == written_off()


def written_off():
    return (0, 0, trigger_effect(0), trigger_effect(0))


@pytest.mark.parametrize(("link", "rate"), [(False, USB_RATE), (True, BLUETOOTH_RATE)])
def test_no_more_reports_than_the_link_bears_and_the_last_force_arrives(link, rate):
    hand, device = opened(pad(link))
    for n in range(1000):
        hand.read(n * PERIOD)
        hand.write((FORCE * n / 1000, 0.0, 0.0))
    assert 0.8 * rate <= len(device.written) <= rate + 1
    for n in range(1000, 1100):
        hand.read(n * PERIOD)
        hand.write(ZERO)
    assert written(device)[-1] == written_off()
    assert len(device.written) <= rate + 2


def test_a_steady_effect_is_refreshed_and_rest_is_not():
    hand, device = opened()
    for n in range(5001):
        hand.read(n * PERIOD)
        hand.write((1.0, 0.0, 0.0) if n < 2000 else ZERO)
    assert len(device.written) == round(2.0 / REFRESH) + 1


def test_closing_ends_every_effect():
    hand, device = opened()
    hand.read(0.0)
    hand.write((FORCE, 0.0, 0.0))
    hand.close()
    hand.close()
    assert [w[0] for w in written(device)] == [255, 0]
    assert device.port is None
    with pytest.raises(DeviceLost):
        hand.write(ZERO)


class Slow(Plugged):
    """A device whose transfers last until a test lets them."""

    def __init__(self, found):
        super().__init__(found)
        self.begun, self.go, self.done = threading.Event(), threading.Event(), threading.Semaphore(0)
        self.threads = set()
        device = self

        class Written(list):
            def append(self, report):
                device.threads.add(threading.get_ident())
                device.begun.set()
                assert device.go.wait(30.0)
                super().append(report)
                device.done.release()

        self.written = Written()


def test_a_transfer_that_lasts_keeps_neither_reading_nor_writing_and_the_newest_goes_next():
    device = Slow(pad().found)
    (spec,) = parse_devices(["dualsense"])
    hand = create(spec, System(device))
    hand.open()
    hand.read(0.0)
    hand.write(ZERO)
    assert device.begun.wait(30.0)
    for n in range(1, 501):  # while the first is under way
        device.reports.append(usb(x=255))
        hand.read(n * PERIOD)
        hand.write((FORCE * n / 400, 0.0, 0.0))
    assert device.written == []
    device.go.set()
    for _ in range(2):
        assert device.done.acquire(timeout=30.0)
    assert [w[0] for w in written(device)] == [0, 255]
    hand.close()
    assert written(device)[-1] == written_off()
    assert device.port is None
    assert threading.get_ident() not in device.threads


def test_a_hand_is_let_go_of_at_once_when_lost_in_a_transfer():
    device = Slow(pad().found)
    (spec,) = parse_devices(["dualsense"])
    hand = create(spec, System(device))
    hand.open()
    hand.read(0.0)
    hand.write(ZERO)
    assert device.begun.wait(30.0)
    port = device.port
    device.unplugged = True
    with pytest.raises(DeviceLost):
        hand.read(PERIOD)
    assert port is not None
    assert not port.closed  # a transfer is under way: the file must not become another's
    thread = next(t for t in threading.enumerate() if t.name == "latest-sender" and t.ident in device.threads)
    device.go.set()
    thread.join(30.0)
    assert port.closed


def test_an_effect_that_could_not_be_sent_loses_the_device():
    hand, device = opened()
    hand.read(0.0)
    device.unplugged = True
    hand.write((1.0, 0.0, 0.0))
    hand._time = 1.0  # no reading in between, which would have noticed
    with pytest.raises(DeviceLost, match="No such device"):
        hand.write((2.0, 0.0, 0.0))
    assert device.port is None


# which one, and the servo


def fails(text, system):
    with pytest.raises(InputError) as caught:
        create(parse_devices([text])[0], system).open()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_absent_and_forbidden_devices_and_bad_arguments_are_one_line_each():
    assert "no DualSense is plugged in" in fails("dualsense", System())
    forbidden = pad()
    forbidden.refuses = PermissionError(13, "Permission denied")
    assert 'KERNELS=="*:054C:0CE6.*"' in fails("dualsense", System(forbidden))
    assert "stick = 'both' must be one of left, right" in fails("dualsense:stick=both", System(pad()))
    assert "force = 0 must be a number from 0.01 to 100" in fails("dualsense:force=0", System(pad()))
    assert "must be one of" in fails("dualsense:gyro=1", System(pad()))


def test_listed_lines_name_each_by_its_address():
    system = System(pad(), pad(True, 1, "11:22:33:44:55:66", 0x0DF2))
    lines = find_devices(system)
    assert [line.split()[0] for line in lines] == ["dualsense:aa:bb:cc:dd:ee:ff", "dualsense:11:22:33:44:55:66"]
    assert "DualSense Edge" in lines[1]
    assert "Bluetooth" in lines[1]
    hands = [create(spec, system) for spec in parse_devices([line.split()[0] for line in lines])]
    for hand in hands:
        assert isinstance(hand, Device)
        hand.open()
    assert all(device.port is not None for device in system.all)
    for hand in hands:
        hand.close()


class Streaming(Plugged):
    """Says the same every 4th reading."""

    count, said = 0, b""

    def next(self):
        self.count += 1
        return self.said if self.count % 5 == 1 else b""


def test_in_the_servo_it_rumbles_falls_quiet_when_lost_or_silent_and_comes_back_disarmed():
    device = Streaming(pad().found)
    device.said = usb(x=255)
    wanted = HidWanted(text="dualsense", what="DualSense", models={(0x054C, 0x0CE6): ""}, usage=(1, 5))
    hand = DualSense(wanted, {"force": 0.3}, system=System(device), sender=AtOnce)
    rig = Rig([hand], chain=lambda info: make_chain(hand_config(clamp=info.force, passivity=None)))
    publish, told = rig.scenes.write, {}
    rig.scenes.write = lambda scene: publish(replace(scene, traps=(TrapNow(0, ZERO, POWER),)))
    rig.next_scene = 0.0
    rig.world()

    def look(name):
        return lambda: told.update({name: (written(device)[-1][0], rig.state(rig.clock.now()).state)})

    def say(report):
        return lambda: setattr(device, "said", report)

    def unplug(away):
        return lambda: setattr(device, "unplugged", away)

    back = 0.9 + 2.5 * REOPEN_AFTER
    rig.run(
        (0.05, rig.arm()),
        (0.08, say(usb())),  # 3 mm along x: the trap is off the sphere
        (0.6, look("armed")),
        (0.6, say(b"")),
        (0.75, look("silent")),
        (0.8, say(usb())),
        (0.9, unplug(True)),
        (1.0, unplug(False)),
        (back, look("back")),
        (back + 0.1, rig.stop),
    )
    assert told["armed"][0] > 0
    assert told["armed"][1] in ("ramping", "armed")
    assert told["silent"][0] == 0
    assert told["back"] == (0, "disarmed")
    assert written(device)[-1] == written_off()
    assert Feel(0, 0) == OFF
