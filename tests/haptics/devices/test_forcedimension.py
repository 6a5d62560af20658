"""Force Dimension devices against a module with the package's functions; neither SDK nor hardware."""

from __future__ import annotations

import dataclasses
import importlib.util
import inspect
import json
import math
import os
import subprocess
import sys
import threading

import pytest

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, Device, DeviceLost
from otwarp.haptics.devices import create_device, forcedimension, parse_devices
from otwarp.haptics.devices.exchange import GONE, HOLD
from otwarp.haptics.devices.forcedimension import ForceDimensionDevice, find_devices
from tests.haptics.devices.conftest import ServedHand, ended
from tests.haptics.dhd_double import EXPERT, FUNCTIONS, Dhd, Robot, Status

INSTALLED = importlib.util.find_spec("forcedimension_core") is not None


@pytest.fixture
def dhd(monkeypatch):
    dhd = Dhd(Robot(10742), Robot(0, 60, "Falcon"))
    monkeypatch.setitem(sys.modules, "forcedimension_core", dhd.module())
    monkeypatch.setitem(sys.modules, "forcedimension_core.containers", dhd.containers())
    yield dhd
    assert dhd.mistakes == [] and not dhd.expert and not forcedimension._open
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("forcedimension ")]
    assert not any(robot.open for robot in dhd.robots)


@pytest.fixture
def device(dhd, clock):
    device = ForceDimensionDevice(10742, name="forcedimension:10742", clock=clock)
    device.open()
    yield device
    device.close()


def test_positions_buttons_and_axes_are_ours(device, dhd):
    assert isinstance(device, Device)
    assert (device.info.kind, device.info.force) == ("forcedimension", 12.0)
    dhd.robots[0].position, dhd.robots[0].buttons = (0.01, 0.02, 0.03), 0b10  # towards the user, right, up
    dhd.turn(dhd.robots[0], 3)
    sample = device.read(2.0)
    assert (sample.time, sample.position, sample.buttons, sample.fresh) == (2.0, (0.02, 0.03, 0.01), 0b10, True)


def test_forces_are_theirs(device, dhd):
    device.write((0.5, -1.0, 0.25))
    dhd.turn(dhd.robots[0], 3)
    assert dhd.robots[0].force == (0.25, 0.5, -1.0) and dhd.robots[0].enabled
    device.write((11.0, 0.0, 0.0))  # a saturated motor is no error
    dhd.turn(dhd.robots[0], 3)
    assert device.read(0.0).fresh


def test_the_servo_makes_no_call_of_the_sdk(device, dhd):
    dhd.robots[0].threads.clear()
    for k in range(5):
        device.write((0.1 * k, 0.0, 0.0))
        device.read(0.001 * k)
    dhd.turn(dhd.robots[0])
    assert dhd.robots[0].threads == {"forcedimension 3"}


@pytest.mark.parametrize("age", [0.0, HOLD, 0.04, 0.06, 0.0999, GONE, 1e9])
def test_the_force_of_a_servo_that_died_falls_to_zero(device, dhd, clock, age):
    device.write((0.0, 3.0, 0.0))
    dhd.turn(dhd.robots[0], 3)
    clock.now = age
    dhd.turn(dhd.robots[0], 3)
    expected = 3.0 * min(1.0, max(0.0, (GONE - age) / (GONE - HOLD)))
    assert dhd.robots[0].force[2] == pytest.approx(expected, rel=1e-9, abs=1e-15)
    assert max(math.hypot(*force) for force in dhd.robots[0].forces) <= 3.0


def test_the_firmware_takes_off_what_a_killed_servo_left(device, dhd, clock):
    """Nothing else can: the SDK ends with its process."""
    assert dhd.robots[0].watchdog == forcedimension.WATCHDOG and device.watched
    most = forcedimension.WATCHDOG * forcedimension.TICK
    assert 3.0 * forcedimension.PACE < most < GONE
    dhd.robots[1].watchdog = None
    without = ForceDimensionDevice(index=1, clock=clock)
    without.open()
    assert not without.watched
    without.close()


@pytest.mark.parametrize(("off_by", "comes_back"), [(forcedimension.OFF_BY_WATCHDOG, True), (1, False)])
def test_after_a_silence_it_enables_what_the_watchdog_took_off(device, dhd, clock, off_by, comes_back):
    robot = dhd.robots[0]
    robot.enabled, robot.off_by = False, off_by
    dhd.turn(robot, 3)
    assert not robot.enabled  # no silence: nothing is asked
    clock.now += 0.05
    dhd.turn(robot, 3)
    assert robot.enabled is comes_back


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_force_that_is_no_number_is_none(device, dhd, bad):
    device.write((bad, 1.0, 0.0))
    dhd.turn(dhd.robots[0], 3)
    assert dhd.robots[0].force == ZERO


def test_a_position_asked_for_too_early_is_not_fresh(device, dhd):
    dhd.robots[0].guarded = True
    dhd.turn(dhd.robots[0], 3)
    while device.read(0.0).fresh:
        pass
    dhd.turn(dhd.robots[0], 3)
    assert not device.read(0.0).fresh
    dhd.robots[0].guarded = False
    dhd.turn(dhd.robots[0], 3)
    assert device.read(0.0).fresh


def test_two_devices_have_a_thread_each(dhd, clock):
    first, second = (create_device(spec) for spec in parse_devices(["forcedimension", "forcedimension"]))
    for one in (first, second):
        one.open()
    assert (first.info.force, second.info.force) == (12.0, 8.0)
    first.write((1.0, 0.0, 0.0))
    second.write((0.0, 1.0, 0.0))
    for robot in dhd.robots:
        dhd.turn(robot, 3)
    assert max(dhd.robots[0].forces) == (0.0, 1.0, 0.0) and max(dhd.robots[1].forces) == (0.0, 0.0, 1.0)
    again = ForceDimensionDevice(10742, clock=clock)
    with pytest.raises(InputError, match="each hand must have its own"):
        again.open()
    dhd.robots[0].plugged = False
    ended(first._service)
    with pytest.raises(DeviceLost):
        first.read(0.0)
    dhd.turn(dhd.robots[1], 3)
    assert second.read(0.0).fresh  # the other goes on
    for one in (first, second):
        one.close()


def test_unplugged_it_is_lost_and_found_again(device, dhd):
    dhd.robots[0].plugged = False
    ended(device._service)
    for call in (lambda: device.read(0.0), lambda: device.write(ZERO)):
        with pytest.raises(DeviceLost, match=r"communication error$"):
            call()
    with pytest.raises(InputError, match="serial number 10742 cannot be opened: no device found"):
        device.open()
    dhd.robots[0].plugged = True
    device.open()
    dhd.turn(dhd.robots[0], 3)
    assert device.read(0.0).fresh and dhd.robots[0].force == ZERO


def test_the_one_that_comes_back_is_the_same_whatever_its_place(dhd, clock):
    first, second = (ForceDimensionDevice(index=index, clock=clock) for index in (0, 1))
    first.open()
    second.open()
    lost = dhd.robots[0]
    lost.plugged = False
    ended(first._service)
    with pytest.raises(InputError, match="serial number 10742 cannot be opened"):
        first.open()  # place 0 is the other's now
    dhd.turn(dhd.robots[1], 3)
    assert second.read(0.0).fresh
    lost.plugged = True
    first.open()
    dhd.turn(lost, 3)
    for one in (first, second):
        one.close()


def test_a_defect_of_the_package_is_a_loss(device, dhd):
    dhd.robots[0].position = ()  # type: ignore[assignment]
    ended(device._service)
    with pytest.raises(DeviceLost, match="ValueError"):
        device.read(0.0)
    assert dhd.robots[0].force == ZERO and dhd.robots[0].braked


def test_after_close_everything_is_zero(device, dhd):
    device.write((1.0, 1.0, 1.0))
    dhd.turn(dhd.robots[0], 3)
    assert dhd.robots[0].force == (1.0, 1.0, 1.0)
    device.close()
    device.close()
    robot = dhd.robots[0]
    assert robot.force == ZERO and not robot.enabled and robot.braked and not robot.open
    for call in (lambda: device.read(0.0), lambda: device.write(ZERO)):
        with pytest.raises(DeviceLost, match="not open"):
            call()


def test_a_device_without_power_is_one_clear_line(dhd, clock):
    dhd.robots[0].powered = False
    with pytest.raises(InputError, match="forces cannot be enabled: device not ready"):
        ForceDimensionDevice(clock=clock).open()


def test_an_absent_device_is_one_clear_line(dhd, clock):
    with pytest.raises(InputError, match="index = 2: 2 found"):
        ForceDimensionDevice(index=2, clock=clock).open()


def test_a_hand_of_the_servo_disarms_and_comes_back(dhd, clock):
    """Unplugged and plugged in again in mid-run, with the servo's own code and a virtual clock."""
    device, robot = ForceDimensionDevice(10742, clock=clock), dhd.robots[0]
    robot.position = (0.0, 0.01, 0.0)
    with ServedHand(device) as hand:
        dhd.turn(robot, 3)
        hand.arm()
        dhd.turn(robot, 3)
        assert robot.force != ZERO
        robot.plugged = False
        ended(device._service)
        hand.run(2)
        assert "communication error" in hand.status.message
        robot.plugged = True
        hand.come_back()
        dhd.turn(robot, 3)
        assert robot.force == ZERO  # disarmed


@pytest.mark.parametrize(
    ("text", "serial", "index"),
    [
        ("forcedimension", None, 0),
        ("forcedimension:10742", 10742, 0),
        ("forcedimension:index=1", None, 1),
    ],
)
def test_specs_say_which(text, serial, index):
    (spec,) = parse_devices([text])
    device = create_device(spec)
    assert isinstance(device, ForceDimensionDevice) and (device._serial, device._index) == (serial, index)


@pytest.mark.parametrize("text", ["omega", "-1", "65536", "index=256", "index=", "serial=1", "1,2", "²", "9" * 5000])
def test_bad_specs_are_one_clear_line(text):
    (spec,) = parse_devices([f"forcedimension:{text}"])
    with pytest.raises(InputError, match="must be forcedimension:<serial number") as error:
        create_device(spec)
    assert "\n" not in str(error.value)


def test_devices_are_found(dhd, device):
    assert find_devices() == ("forcedimension:10742  omega.3, 12 N", "forcedimension:index=1  Falcon, 8 N")
    dhd.turn(dhd.robots[0], 3)
    assert device.read(0.0).fresh  # one in use stays open
    device.close()
    for robot in dhd.robots:
        robot.plugged = False
    assert find_devices() == ()


def test_without_package_or_sdk_it_says_what_to_install(monkeypatch, capfd):
    if not INSTALLED:
        monkeypatch.setitem(sys.modules, "forcedimension_core", None)
    for call in (ForceDimensionDevice().open, find_devices):
        with pytest.raises(InputError, match=r"pip install 'otwarp\[forcedimension\]'.* SDK 3\.16") as error:
            call()
        assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("said", "kept"),
    [
        ("Cannot load libdrd. Is it\n there? Look. For more consult: ", "Cannot load libdrd. Is it there? Look."),
        ("Cannot load libdrd. For more information consult: ", "Cannot load libdrd."),
        ("libdrd.so.3: cannot open: No such file", "libdrd.so.3: cannot open: No such file"),
        ("Too old. Wanted: 3.16", "Too old. Wanted: 3.16"),
        ("consult: ", "consult"),
        ("", "ImportError"),
    ],
)
def test_what_the_package_says_ends_with_a_whole_sentence(said, kept, monkeypatch):
    def _fail(name):
        raise ImportError(said)

    monkeypatch.setattr(forcedimension, "import_module", _fail)
    with pytest.raises(InputError) as error:
        forcedimension.sdk()
    assert str(error.value).endswith(kept) and "consult" not in str(error.value).removesuffix(kept)


@pytest.mark.skipif(not INSTALLED, reason="forcedimension-core is not installed: nothing to compare the double with")
def test_the_double_has_the_signatures_of_the_package():
    """In a process of its own, in which the package takes a mock for the SDK."""
    program = (
        "import inspect, json; from forcedimension_core import dhd\n"
        f"print(json.dumps({{n: list(inspect.signature(getattr(dhd, n)).parameters) for n in {FUNCTIONS!r}}}))\n"
        f"expert = {{n: list(inspect.signature(getattr(dhd.expert, n)).parameters) for n in {EXPERT!r}}}\n"
        "print(json.dumps(expert))\n"
        "from forcedimension_core.containers import Status\n"
        "print(json.dumps([name for name, _ in Status._fields_]))\n"
        "from forcedimension_core.constants import DeviceType, ForceOffCause, TIMEGUARD\n"
        "print(json.dumps([TIMEGUARD, ForceOffCause.WATCHDOG.value, {t.name: t.value for t in DeviceType}]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "__fdsdkpy_unittest__": "True"},
        capture_output=True,
        text=True,
        check=True,
    )
    signatures, expert, fields, (timeguard, watchdog, types) = map(json.loads, done.stdout.splitlines())
    dhd = Dhd()
    assert signatures == {name: list(inspect.signature(getattr(dhd, name)).parameters) for name in FUNCTIONS}
    assert expert == {name: list(inspect.signature(getattr(dhd, name)).parameters) for name in EXPERT}
    assert {field.name for field in dataclasses.fields(Status)} <= set(fields)
    assert (timeguard, watchdog) == (forcedimension.TIMEGUARD, forcedimension.OFF_BY_WATCHDOG)
    known = {types[name] for name in types if name.startswith(("FALCON", "DELTA", "OMEGA"))}
    assert known == set(forcedimension.LARGEST_FORCE)
