"""OpenHaptics against a double of its library that the system's C compiler makes; what it doubles is in its source.

The double's scheduler is a real thread that calls back each millisecond, but nothing here depends on how long anything
takes: tests wait for whole ticks, and the age of a force is that of a clock of the test.
"""

from __future__ import annotations

import ctypes
import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, Device, DeviceLost
from otwarp.haptics.devices import create_device, openhaptics, parse_devices
from otwarp.haptics.devices.exchange import GONE, HOLD, LOST, SILENCE
from otwarp.haptics.devices.libhd import OVERRIDE
from otwarp.haptics.devices.openhaptics import OpenHapticsDevice
from otwarp.haptics.servo.link import HandSetup
from otwarp.haptics.servo.process import ServoProcess
from tests.haptics.devices.conftest import Clock, ServedHand
from tests.haptics.libhd_double import Double
from tests.haptics.servo.test_servo_process import publishing, until
from tests.haptics.spring import SpringChain

EXACT = 1e-12
"""Relative: one product of doubles."""
LEFT, RIGHT = "Left Geomagic Touch", "Right Geomagic Touch"
COMM_ERROR, WARM_MOTORS = 0x0302, 0x0200


@pytest.fixture
def double(library, monkeypatch):
    monkeypatch.setenv(OVERRIDE, library)
    double = Double(library)
    double.reset()
    double.add(LEFT, "L-17", 3.3, 0.88)
    double.add(RIGHT, "R-18", 7.9, 1.75)
    yield double
    openhaptics.shared_scheduler().shutdown()
    assert double.mistakes() == 0  # calls that the real library would not take
    assert not double.running() and not double.scheduled()


def opened(name: str | None, clock: Clock) -> OpenHapticsDevice:
    device = OpenHapticsDevice(name, f"openhaptics:{name}", clock)
    device.open()
    return device


def test_a_touch_is_read_in_metres_and_feels_newtons(double, clock):
    (spec,) = parse_devices([f'openhaptics:"{LEFT}"'])
    device = create_device(spec)
    assert isinstance(device, Device)
    device._clock = clock
    device.open()
    assert (device.info.force, device.info.continuous_force) == (3.3, 0.88)
    assert device.info.kind == "openhaptics"
    double.move(0, 10.0, -20.0, 30.5, 0b10)
    double.tick()
    sample = device.read(1.0)
    assert sample.position == pytest.approx((0.010, -0.020, 0.0305), rel=EXACT)
    assert (sample.time, sample.buttons, sample.fresh) == (1.0, 0b10, True)
    device.write((0.5, -1.0, 0.25))
    double.tick()
    assert double.force(0) == (0.5, -1.0, 0.25)
    device.close()


def test_a_sample_is_fresh_once(double, clock):
    device = opened(LEFT, clock)
    double.tick()
    double.stall(1)
    first = device.read(0.0)
    while device.read(0.0).fresh:  # the tick under way when it stalled
        pass
    later = device.read(SILENCE)
    assert first.fresh and not later.fresh
    double.stall(0)
    double.tick()
    assert device.read(SILENCE).fresh


def test_a_scheduler_that_falls_silent_releases_the_buttons_and_is_lost(double, clock):
    device = opened(LEFT, clock)
    double.move(0, 0.0, 0.0, 0.0, 1)
    double.tick()
    double.stall(1)
    while device.read(0.0).fresh:
        pass
    assert device.read(0.9 * SILENCE).buttons == 1
    assert device.read(1.1 * SILENCE).buttons == 0
    with pytest.raises(DeviceLost, match="silent"):
        device.read(1.1 * LOST)
    double.stall(0)


def test_two_devices_share_one_callback_at_the_highest_priority(double, clock):
    left, right = opened(LEFT, clock), opened(RIGHT, clock)
    assert double.most_scheduled() == 1 and ctypes.c_ushort(double.priority()).value == 0xFFFF
    double.move(0, 1.0, 2.0, 3.0, 1)
    double.move(1, -4.0, -5.0, -6.0, 2)
    left.write((0.1, 0.0, 0.0))
    right.write((0.0, 0.2, 0.0))
    double.tick()
    assert left.read(0.0).position == pytest.approx((0.001, 0.002, 0.003), rel=EXACT)
    assert right.read(0.0).position == pytest.approx((-0.004, -0.005, -0.006), rel=EXACT)
    assert (left.read(0.0).buttons, right.read(0.0).buttons) == (1, 2)
    assert double.force(0) == (0.1, 0.0, 0.0) and double.force(1) == (0.0, 0.2, 0.0)
    assert abs(double.frames(0) - double.frames(1)) < double.frames(0)  # both are served
    assert (left.info.force, right.info.force) == (3.3, 7.9)
    left.close()
    assert double.running() and not double.open(0)
    double.tick()
    assert double.force(1) == (0.0, 0.2, 0.0)
    right.close()
    assert not double.running()


def test_opening_the_second_does_not_disturb_the_first(double, clock):
    """The double makes a device current for the whole process while it is being initialised."""
    left = opened(LEFT, clock)
    double.move(0, 1.0, 1.0, 1.0, 0)
    double.move(1, 900.0, 900.0, 900.0, 0)
    left.write((1.0, 0.0, 0.0))
    double.tick()
    left.read(0.0)
    double.delay(20)
    before = double.frames(0)
    right = opened(RIGHT, clock)
    assert double.frames(0) > before  # the first was served meanwhile
    assert double.peak(1) == 0.0
    double.tick()
    assert left.read(0.0).position == pytest.approx((0.001, 0.001, 0.001), rel=EXACT)
    assert double.force(0) == (1.0, 0.0, 0.0) and double.force(1) == ZERO
    right.close()


def test_a_frame_in_which_another_device_became_current_reads_and_moves_neither(double, clock):
    left, right = opened(LEFT, clock), opened(RIGHT, clock)
    double.move(0, 1.0, 1.0, 1.0, 0)
    double.move(1, 900.0, 900.0, 900.0, 0)
    left.write((1.0, 0.0, 0.0))
    double.tick()
    for device in (left, right):
        device.read(0.0)
    double.peak(1)
    for _ in range(20):
        double.steal(1)
        double.tick()
        assert double.stolen()
        assert left.read(0.0).position == pytest.approx((0.001, 0.001, 0.001), rel=EXACT)
    assert double.peak(1) == 0.0 and double.force(0) == (1.0, 0.0, 0.0)


def test_looking_for_an_absent_device_does_not_disturb_the_other(double, clock):
    left = opened(LEFT, clock)
    left.write((1.0, 0.0, 0.0))
    double.plug(1, 0)
    double.delay(20)
    with pytest.raises(InputError, match="HD_DEVICE_FAULT"):
        opened(RIGHT, clock)
    double.tick()
    assert double.force(0) == (1.0, 0.0, 0.0)
    assert left.read(0.0).fresh


@pytest.mark.parametrize("age", [0.0, HOLD, 0.04, 0.06, 0.08, 0.0999, GONE, 0.2, 1e9])
def test_the_force_of_a_servo_that_died_falls_to_zero(double, clock, age):
    device = opened(LEFT, clock)
    device.write((0.0, 3.0, 0.0))
    double.tick()
    clock.now = age
    double.tick()
    expected = 3.0 * min(1.0, max(0.0, (GONE - age) / (GONE - HOLD)))
    assert double.force(0)[1] == pytest.approx(expected, rel=1e-9, abs=1e-15)
    assert double.peak(0) <= 3.0


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(*[st.one_of(st.floats(-5.0, 5.0), st.sampled_from([math.nan, math.inf]))] * 3), max_size=4),
    st.floats(0.0, 0.2),
)
def test_no_frame_has_more_force_than_was_written(double, forces, wait):
    clock = Clock()
    device = opened(LEFT, clock)
    double.peak(0)
    for force in forces:
        device.write(force)
        double.tick()
        clock.now += wait
        double.tick()
        size = math.hypot(*force)
        assert double.peak(0) <= (size * (1.0 + 1e-12) if math.isfinite(size) else 0.0)
        device.write(ZERO)
        double.tick()
        double.peak(0)
    device.close()
    assert double.force(0) == ZERO


def test_unplugging_one_loses_it_and_not_the_other(double, clock):
    left, right = opened(LEFT, clock), opened(RIGHT, clock)
    right.write((0.0, 0.0, 1.0))
    double.plug(0, 0)
    double.tick()
    for call in (lambda: left.read(0.0), lambda: left.write(ZERO)):
        with pytest.raises(DeviceLost, match=r"HD_COMM_ERROR \(0x0302\)"):
            call()
    double.tick()
    assert right.read(0.0).fresh and double.force(1) == (0.0, 0.0, 1.0)
    with pytest.raises(InputError, match="cannot be opened"):
        left.open()
    double.plug(0, 1)
    left.open()
    double.tick()
    assert left.read(0.0).fresh and double.force(0) == ZERO
    assert double.force(1) == (0.0, 0.0, 1.0) and double.most_scheduled() == 1


def test_an_error_of_a_device_that_is_still_there_leaves_no_force_on(double, clock):
    left, right = opened(LEFT, clock), opened(RIGHT, clock)
    left.write((2.0, 0.0, 0.0))
    right.write((0.0, 1.0, 0.0))
    double.tick()
    double.fail(0, COMM_ERROR, 0)
    double.tick()
    double.tick()
    with pytest.raises(DeviceLost):
        left.read(0.0)
    assert double.force(0) == ZERO and double.told(0) == ZERO and not double.enabled(0)
    assert double.force(1) == (0.0, 1.0, 0.0)


def test_an_error_ends_the_device_that_it_names(double, clock):
    left, right = opened(LEFT, clock), opened(RIGHT, clock)
    left.write((2.0, 0.0, 0.0))
    double.tick()
    double.fail(0, COMM_ERROR, 1)  # in the frame of the left one, about the right one
    double.tick()
    double.tick()
    with pytest.raises(DeviceLost):
        right.read(0.0)
    assert left.read(0.0).fresh and double.force(0) == (2.0, 0.0, 0.0)


@pytest.mark.parametrize("where", ["force", "put"])
def test_a_defect_in_the_callback_is_a_loss(double, clock, monkeypatch, where):
    left, right = opened(LEFT, clock), opened(RIGHT, clock)
    left.write((1.0, 0.0, 0.0))
    double.tick()
    monkeypatch.setattr(left._exchange, where, lambda *_: 1 / 0)
    double.tick()
    double.tick()
    with pytest.raises(DeviceLost, match="ZeroDivisionError"):
        left.read(0.0)
    assert double.told(0) == ZERO and not double.enabled(0)
    assert right.read(0.0).fresh


def test_a_scheduler_that_does_not_call_back_is_one_clear_line(double, clock, monkeypatch):
    monkeypatch.setattr(openhaptics, "ANSWER_WITHIN", 0.02)
    double.stall(1)
    with pytest.raises(InputError, match="the scheduler of OpenHaptics does not serve it"):
        opened(LEFT, clock)
    assert not double.running() and not double.open(0)


def test_a_warm_motor_is_no_loss(double, clock):
    device = opened(LEFT, clock)
    double.fail(0, WARM_MOTORS, 0)
    double.tick()
    assert device.read(0.0).fresh and device.warnings == 1


def test_a_position_that_is_no_number_is_dropped(double, clock):
    device = opened(LEFT, clock)
    double.move(0, 1.0, 1.0, 1.0, 0)
    double.tick()
    device.read(0.0)
    double.move(0, math.nan, 0.0, 0.0, 0)
    double.tick()
    while device.read(0.0).fresh:  # samples taken before the move
        pass
    double.tick()
    assert not device.read(0.0).fresh
    assert device.read(0.0).position == pytest.approx((0.001, 0.001, 0.001), rel=EXACT)


def test_after_close_everything_is_zero(double, clock):
    device = opened(None, clock)  # the default device is the first
    device.write((1.0, 1.0, 1.0))
    double.tick()
    assert double.force(0) == (1.0, 1.0, 1.0)
    device.close()
    device.close()
    assert double.force(0) == ZERO and double.told(0) == ZERO
    assert not double.enabled(0) and not double.open(0) and not double.running()
    for call in (lambda: device.read(0.0), lambda: device.write(ZERO)):
        with pytest.raises(DeviceLost, match="not open"):
            call()
    device.open()
    double.tick()
    assert device.read(0.0).fresh and double.force(0) == ZERO


def test_one_device_is_not_for_two_hands(double, clock):
    left = opened(LEFT, clock)
    with pytest.raises(InputError, match="each hand must have its own"):
        opened(None, clock)  # the default is the same one
    left.write((1.0, 0.0, 0.0))
    double.tick()
    assert double.force(0) == (1.0, 0.0, 0.0)
    with pytest.raises(InputError, match="both hands name it"):
        parse_devices([f"openhaptics:{LEFT}", f"openhaptics:{LEFT}"])
    _, second = parse_devices(["openhaptics", "openhaptics"])
    with pytest.raises(InputError, match="for both hands"):
        create_device(second)


def test_a_device_that_does_not_say_its_forces_is_a_touch(double, clock):
    double.add("Silent", "0", 0.0, 0.0)
    assert opened("Silent", clock).info.force == openhaptics.TOUCH_FORCES[0]


def test_devices_are_found_by_the_names_of_touch_setup(double, clock, monkeypatch, tmp_path):
    monkeypatch.setenv("GTDD_HOME", str(tmp_path))
    (tmp_path / "config").mkdir()
    for name in (LEFT, RIGHT, "Forgotten Touch"):
        (tmp_path / "config" / f"{name}.config").write_text("")
    lines = openhaptics.find_devices()
    assert len(lines) == 2  # the default device is the left one
    assert lines[0] == f'openhaptics:"{LEFT}"  Touch, serial number L-17, 3.3 N, 0.88 N continuous'
    assert lines[1].startswith(f'openhaptics:"{RIGHT}"  Touch, serial number R-18')
    assert not double.open(0) and not double.open(1)
    (spec,) = parse_devices([lines[1].split("  ")[0]])
    device = create_device(spec)
    device.open()
    assert double.open(1)
    with pytest.raises(InputError, match="before any of them is opened"):
        openhaptics.find_devices()
    device.close()


def test_a_system_without_devices_finds_none(double, monkeypatch, tmp_path):
    monkeypatch.setenv("GTDD_HOME", str(tmp_path))
    double.plug(0, 0)
    double.plug(1, 0)
    assert openhaptics.find_devices() == ()


def test_a_hand_of_the_servo_disarms_and_comes_back(double, clock):
    """Unplugged and plugged in again in mid-run, with the servo's own code and a virtual clock."""
    with ServedHand(OpenHapticsDevice(LEFT, "openhaptics", clock), double.tick) as hand:
        double.move(0, 10.0, 0.0, 0.0, 0)
        hand.arm()
        assert double.force(0) != ZERO
        double.plug(0, 0)
        hand.run(3)
        assert hand.status.losses == 1 and "HD_COMM_ERROR" in hand.status.message
        double.plug(0, 1)
        hand.come_back()
        assert double.force(0) == ZERO  # disarmed
    assert not double.open(0)


def test_the_servo_process_serves_two_hands(library, monkeypatch):
    """The whole way, in the servo's own process, which a test cannot reach into: it sees the hands' mailboxes."""
    monkeypatch.setenv(OVERRIDE, library)
    monkeypatch.setenv("LIBHD_DOUBLE_DEVICES", f"{LEFT},{RIGHT}")
    hands = [HandSetup(f'openhaptics:"{name}"', SpringChain) for name in (LEFT, RIGHT)]
    with ServoProcess(hands, spheres=1, traps=1) as servo:
        publish = publishing(servo)
        for hand, x in ((0, 0.01), (1, 0.02)):
            until(lambda hand=hand: (now := servo.hand(hand)) is not None and now.force[0] < 0.0, publish)
            assert servo.hand(hand).position[0] == pytest.approx(x, rel=EXACT)
        assert all(hand.present for hand in servo.status().hands)
    assert [servo.hand(hand).force for hand in (0, 1)] == [ZERO, ZERO]
    absent = ServoProcess([HandSetup("openhaptics:Nobody's", SpringChain)], spheres=1, traps=1)
    with pytest.raises(InputError, match="cannot be opened: HD_DEVICE_FAULT"):
        absent.start()
    absent.stop()
