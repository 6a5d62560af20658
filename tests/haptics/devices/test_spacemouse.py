"""The SpaceMouse on bytes that others recorded, and on bytes made to the documented layout.

Recorded: SpaceNavigator, AndunHH/spacemouse, SpaceNavigator.md (Wireshark); SpaceMouse Compact, prascle in
CloudCompare/CloudCompare pull request 2339. Made: everything of 13 bytes, after pyspacenavigator and the report
descriptor of a SpaceMouse Wireless in AndunHH/spacemouse.
"""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, Device, DeviceLost
from otwarp.haptics.devices import parse_devices
from otwarp.haptics.devices.hid import LONGEST_STEP, HidFound
from otwarp.haptics.devices.spacemouse import MODELS, MOST_REPORTS, SILENCE, SpaceMouseState, create, find_devices
from otwarp.haptics.servo.hand import REOPEN_AFTER
from tests.haptics.hid_double import Plugged, System
from tests.haptics.servo.rig import Rig

PERIOD = 1e-3
ROUNDING = 1e-9
"""Metres: a thousand steps of 1e-4 m add up to 1e-13 in double precision; full speed is shortened by 1e-12."""
DUST = 1e-14
"""Metres: what rounding of places of up to 10 m leaves of a step."""
SPEED = 0.1


def mouse(number=0, serial="", product=0xC635, vendor=0x256F, usages=((1, 8),)):
    return Plugged(
        HidFound(
            path=f"/dev/hidraw{number}",
            vendor=vendor,
            product=product,
            serial=serial,
            place=f"usb-0000:00:14.0-{number + 1}/input0",
            name="3Dconnexion SpaceMouse",
            usages=usages,
        )
    )


def asked(text, system, hands=()):
    """The device of the last hand of those named."""
    return create(parse_devices([*hands, text])[-1], system)


def opened(device=None, text="spacemouse:dead_zone=0"):
    device = device or mouse()
    hand = asked(text, System(device))
    hand.open()
    return hand, device


def push(right=0, near=0, down=0):
    return struct.pack("<B3h", 1, right, near, down)


def run(hand, device, seconds, report=None, start=0.0):
    """Samples of a servo at 1 kHz; the report comes every 8 ms."""
    samples = []
    for n in range(round(seconds / PERIOD) + 1):
        if report is not None and n % 8 == 0:
            device.reports.append(report)
        samples.append(hand.read(start + n * PERIOD))
    return samples


# decoding


def test_recorded_reports_of_a_space_navigator():
    state = SpaceMouseState()
    assert state.take(bytes.fromhex("01 00 00 00 00 00 00"))
    assert not state.take(bytes.fromhex("02 00 00 e2 ff 00 00"))
    assert (state.translation, state.rotation, state.buttons) == ((0, 0, 0), (0, -30, 0), 0)
    held = []
    for report in ("03 01 00", "03 00 00", "03 02 00", "03 00 00", "03 03 00"):
        state.take(bytes.fromhex(report))
        held.append(state.buttons)
    assert held == [1, 0, 2, 0, 3]
    assert state.rotation == (0, -30, 0)


def test_recorded_reports_of_a_compact_press_the_cap_down():
    hand, device = opened()
    for report in ("02 20 00 00 00 17 00", "01 12 00 00 00 f8 00", "02 20 00 00 00 19 00", "01 12 00 00 00 12 01"):
        device.reports.append(bytes.fromhex(report))
    hand.read(0.0)
    x, y, z = hand.read(PERIOD).position
    assert (x, y, z) == pytest.approx((SPEED * PERIOD * 18 / 350, -SPEED * PERIOD * 274 / 350, 0.0), abs=ROUNDING)


def test_one_report_of_six_axes_as_wireless_models_send_it():
    state = SpaceMouseState()
    assert state.take(struct.pack("<B6h", 1, 1, -2, 3, -4, 5, -32768))
    assert (state.translation, state.rotation) == ((1, -2, 3), (-4, 5, -32768))


def test_buttons_beyond_the_first_byte_and_no_more_than_32():
    state = SpaceMouseState()
    state.take(bytes([3, 0x02, 0x10, 0x80, 0x04, 0xFF, 0xFF]))
    assert state.buttons == 1 << 1 | 1 << 12 | 1 << 23 | 1 << 26


@given(report=st.binary(max_size=6))
def test_short_and_unknown_reports_change_no_motion(report):
    state = SpaceMouseState()
    state.take(push(1, 2, 3))
    state.take(report)
    assert (state.translation, state.rotation) == ((1, 2, 3), (0, 0, 0))


# motion


@pytest.mark.parametrize(
    ("report", "way"),
    [
        (push(right=350), (1, 0, 0)),
        (push(right=-350), (-1, 0, 0)),
        (push(down=-350), (0, 1, 0)),
        (push(down=350), (0, -1, 0)),
        (push(near=350), (0, 0, 1)),
        (push(near=-350), (0, 0, -1)),
    ],
)
def test_full_deflection_moves_at_full_speed_right_up_and_towards_the_user(report, way):
    hand, device = opened(text="spacemouse")
    end = run(hand, device, 1.0, report)[-1]
    assert end.position == pytest.approx(tuple(SPEED * w for w in way), abs=ROUNDING)
    assert not hand.info.absolute
    assert hand.info.force == 0.0


def test_half_way_beyond_the_dead_zone_is_half_the_speed_and_within_it_is_rest():
    hand, device = opened(text="spacemouse:speed=0.2,dead_zone=0.2")
    assert run(hand, device, 0.5, push(right=70, near=-70))[-1].position == ZERO
    end = run(hand, device, 1.0, push(right=210), start=1.0)[-1]
    assert end.position == pytest.approx((0.2 * 0.5, 0.0, 0.0), abs=1e-3)  # the first reading still rests


def test_a_diagonal_is_no_faster_than_an_axis():
    hand, device = opened()
    end = run(hand, device, 1.0, push(32767, -32768, 32767))[-1].position
    assert math.hypot(*end) == pytest.approx(SPEED, abs=ROUNDING)
    assert math.hypot(*end) <= SPEED


def test_a_released_cap_stops_by_its_zeros_and_silence_at_rest_is_fresh():
    hand, device = opened()
    at = run(hand, device, 0.1, push(right=350))[-1].position
    device.reports.append(push())
    stops = hand.read(0.101).position
    later = run(hand, device, 2.0, start=0.102)
    assert stops[0] > at[0]
    assert all(sample.position == stops and sample.fresh for sample in later)


def test_a_deflected_cap_that_falls_silent_stops():
    hand, device = opened()
    run(hand, device, 0.1, push(right=350))  # the last report at 0.096 s
    end = run(hand, device, 1.0, start=0.101)[-1].position[0]
    assert end == pytest.approx(SPEED * (0.096 + SILENCE), abs=2 * SPEED * PERIOD)


def test_a_loop_that_stood_still_does_not_make_the_hand_leap():
    hand, device = opened()
    device.reports.append(push(right=350))
    hand.read(0.0)
    assert hand.read(60.0).position[0] == pytest.approx(SPEED * LONGEST_STEP, abs=ROUNDING)


def test_reports_that_queued_before_the_first_reading_do_not_move_it():
    hand, device = opened()
    device.reports.extend([push(right=350)] * 10)
    assert hand.read(100.0).position == ZERO


def test_a_device_that_floods_does_not_hold_the_loop():
    hand, device = opened()
    device.reports.extend([push(right=1)] * (3 * MOST_REPORTS))
    hand.read(0.0)
    assert len(device.reports) == 2 * MOST_REPORTS


reports = st.one_of(
    st.binary(max_size=80),
    st.builds(lambda number, rest: bytes([number]) + rest, st.integers(1, 3), st.binary(max_size=14)),
)


@given(
    steps=st.lists(st.tuples(st.floats(-1.0, 5.0), st.lists(reports, max_size=4)), max_size=30),
    speed=st.floats(1e-3, 1.0),
)
@settings(max_examples=200, deadline=None)
def test_no_bytes_raise_leap_or_leave_the_numbers(steps, speed):
    hand, device = opened(text=f"spacemouse:speed={speed!r}")
    time, before = 0.0, hand.read(0.0).position
    for elapsed, said in steps:
        time, elapsed = time + elapsed, (time + elapsed) - time
        device.reports.extend(said)
        sample = hand.read(time)
        moved = math.dist(sample.position, before)
        assert moved <= speed * min(max(elapsed, 0.0), LONGEST_STEP) * (1 + ROUNDING) + DUST
        assert all(map(math.isfinite, sample.position))
        assert 0 <= sample.buttons < 2**32
        before = sample.position


# which one


def test_two_hands_take_the_first_and_the_second():
    system = System(mouse(0), mouse(1))
    first, second = (create(spec, system) for spec in parse_devices(["spacemouse", "spacemouse"]))
    first.open()
    second.open()
    assert isinstance(first, Device)
    assert [device.port is not None for device in system.all] == [True, True]


@pytest.mark.parametrize(
    "text", ["spacemouse:ab12", "spacemouse:AB12,speed=0.05", "spacemouse:#2", "spacemouse:#2,speed=1"]
)
def test_a_serial_or_a_number_names_one(text):
    system = System(mouse(0, "ZZ"), mouse(1, "AB12"))
    asked(text, system).open()
    assert [device.port is not None for device in system.all] == [False, True]


def test_only_the_multi_axis_interface_of_a_receiver_counts():
    keyboard = mouse(0, product=0xC652, usages=((1, 6), (1, 2)))
    cap, other = mouse(1, product=0xC652), mouse(2, vendor=0x046D, product=0xC077, usages=((1, 8),))
    asked("spacemouse", System(other, keyboard, cap)).open()
    assert cap.port is not None


def expect_refusal(text, system, hands=()):
    with pytest.raises(InputError) as caught:
        asked(text, system, hands).open()
    message = str(caught.value)
    assert "\n" not in message
    assert text in message
    return message


def test_absent_taken_forbidden_and_broken_devices_are_one_line_each():
    assert "no SpaceMouse is plugged in" in expect_refusal("spacemouse", System())
    assert "only 1 is plugged in" in expect_refusal("spacemouse:#2", System(mouse()))
    assert "must be one of: AB, one without serial (#2)" in expect_refusal(
        "spacemouse:XY", System(mouse(0, "AB"), mouse(1))
    )
    device = mouse()
    asked("spacemouse:#1", System(device)).open()
    assert "in use already" in expect_refusal("spacemouse:#1,speed=1", System(device))
    forbidden, broken = mouse(), mouse()
    forbidden.refuses, broken.refuses = PermissionError(13, "Permission denied"), OSError(5, "Input/output error")
    message = expect_refusal("spacemouse", System(forbidden))
    assert 'KERNEL=="hidraw*", KERNELS=="*:256F:C635.*", TAG+="uaccess"' in message
    assert "/etc/udev/rules.d/" in message
    assert "Input/output error" in expect_refusal("spacemouse", System(broken))


@pytest.mark.parametrize(
    "text",
    [
        "spacemouse:speed=0",
        "spacemouse:speed=nan",
        "spacemouse:speed=fast",
        "spacemouse:dead_zone=1",
        "spacemouse:#0",
        "spacemouse:#" + "9" * 5000,
        "spacemouse:#two",
        "spacemouse:#2,gain=3",
        "spacemouse:AB,speed=1,speed=1",
    ],
)
def test_bad_arguments_are_one_line_that_names_them(text):
    expect_refusal(text, System(mouse()))


def test_what_is_plugged_in_is_listed_with_the_text_to_ask_for_it():
    shut = mouse(2)
    shut.found = HidFound(path="/dev/hidraw2", vendor=0x046D, product=0xC626, usages=((1, 8),), allowed=False)
    system = System(mouse(0, "AB12"), mouse(1), shut)
    lines = find_devices(system)
    assert [line.split()[0] for line in lines] == ["spacemouse:AB12", "spacemouse:#2", "spacemouse:#3"]
    assert MODELS[0x256F, 0xC635] in lines[0]
    assert "udev" in lines[2]
    for line in lines:
        asked(line.split()[0], system).open()
    assert find_devices(System()) == ()


# unplugging


def test_unplugged_it_is_lost_and_plugged_in_again_it_goes_on_from_where_it_was():
    hand, device = opened()
    at = run(hand, device, 0.1, push(right=350))[-1].position
    device.unplugged = True
    with pytest.raises(DeviceLost, match="No such device"):
        hand.read(0.101)
    with pytest.raises(DeviceLost, match="not open"):
        hand.read(0.102)
    with pytest.raises(InputError):
        hand.open()
    device.unplugged = False
    hand.open()
    assert run(hand, device, 1.0, start=5.0)[-1].position == at
    hand.close()
    hand.close()
    hand.write((1.0, 0.0, 0.0))
    assert device.port is None


@pytest.mark.parametrize("serials", [("", ""), ("A", "B")])
def test_both_unplugged_the_hands_do_not_come_back_exchanged(serials):
    one, two = mouse(0, serials[0]), mouse(1, serials[1])
    system = System(one, two)
    left, right = (create(spec, system) for spec in parse_devices(["spacemouse", "spacemouse"]))
    left.open()
    right.open()
    one.unplugged = two.unplugged = True
    for hand in (left, right):
        with pytest.raises(DeviceLost):
            hand.read(0.0)
    two.unplugged = False
    with pytest.raises(InputError, match="not plugged in again"):
        left.open()
    right.open()
    one.unplugged = False
    left.open()
    two.reports.append(bytes([3, 1, 0]))
    assert (left.read(1.0).buttons, right.read(1.0).buttons) == (0, 1)


def test_in_the_servo_it_disarms_when_unplugged_and_comes_back_disarmed():
    device = mouse()
    rig = Rig([asked("spacemouse", System(device))])
    seen = {}

    def plugged(there):
        return lambda: setattr(device, "unplugged", not there)

    def look(name):
        return lambda: seen.update({name: (rig.status.read().hands[0], rig.state(rig.clock.now()))})

    rig.run(
        (0.05, rig.arm()),
        (0.05, lambda: device.reports.append(push(right=350))),
        (0.2, plugged(False)),
        (0.3, look("away")),
        (0.4, plugged(True)),
        (0.2 + 2.5 * REOPEN_AFTER, look("back")),
        (0.3 + 2.5 * REOPEN_AFTER, rig.stop),
    )
    (away, there), (back, here) = seen["away"], seen["back"]
    assert (away.present, away.losses) == (False, 1)
    assert "lost, disarmed (No such device)" in away.message
    assert back.present
    assert "arm it to feel it again" in back.message
    assert here.state == "disarmed"
    assert here.position == there.position
    assert there.position[0] > 0.0
    assert device.port is None
