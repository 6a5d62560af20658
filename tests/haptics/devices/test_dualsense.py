"""The DualSense as a device: motion, what stands in for force, links, the servo. Its bytes: `test_dualsense_report`."""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.haptics.core import ZERO, Device, DeviceLost, TrapFrame
from otwarp.haptics.devices import parse_devices
from otwarp.haptics.devices.dualsense import (
    BLUETOOTH_RATE,
    INPUT_SEED,
    RANGES,
    REFRESH,
    SILENCE,
    USB_RATE,
    DualSense,
    checksum,
    create,
    find_devices,
    trigger_effect,
)
from otwarp.haptics.devices.hid import LONGEST_STEP, HidFound, HidWanted
from otwarp.haptics.servo.hand import REOPEN_AFTER
from tests.haptics.devices.test_dualsense_report import RECORDED_SIMPLE, bluetooth, usb
from tests.haptics.hid_double import AtOnce, Plugged, System
from tests.haptics.servo.rig import Rig
from tests.haptics.setups import POWER, hand_config, make_chain

PERIOD = 1e-3
ROUNDING = 1e-9
"""Relative, and in metres: sums of a thousand steps in double precision are good to 1e-13."""
DUST = 1e-14
"""Metres: what rounding of places of up to 10 m leaves of a step."""
QUIET, SPEED, FORCE = (0, 0, trigger_effect(0), trigger_effect(0)), RANGES["speed"][0], RANGES["force"][0]


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
    assert (hand.info.force, hand.info.continuous_force) == (2.0, 2.0)
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
    assert written(device)[-1] == QUIET


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
    assert written(device)[-1] == QUIET
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
    assert written(device)[-1] == QUIET
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


def test_only_closing_waits_for_the_last_report():
    waits = []

    class Sender(AtOnce):
        def close(self, last, wait=True):
            waits.append(wait)
            super().close(last, wait)

    hand, device = opened(sender=Sender)
    device.unplugged = True
    with pytest.raises(DeviceLost):
        hand.read(0.0)
    device.unplugged = False
    hand.open()
    hand.close()
    assert waits == [False, True]


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


def expect_refusal(text, system):
    with pytest.raises(InputError) as caught:
        create(parse_devices([text])[0], system).open()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_absent_and_forbidden_devices_and_bad_arguments_are_one_line_each():
    assert "no DualSense is plugged in" in expect_refusal("dualsense", System())
    forbidden = pad()
    forbidden.refuses = PermissionError(13, "Permission denied")
    assert 'KERNELS=="*:054C:0CE6.*"' in expect_refusal("dualsense", System(forbidden))
    assert "stick = 'both' must be one of left, right" in expect_refusal("dualsense:stick=both", System(pad()))
    assert "force = 0 must be a number from 0.01 to 100" in expect_refusal("dualsense:force=0", System(pad()))
    assert "must be one of" in expect_refusal("dualsense:gyro=1", System(pad()))


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
    """Says the same every 4th cycle, each of which reads until nothing waits."""

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
    rig.scenes.write = lambda scene: publish(replace(scene, traps=(TrapFrame(0, ZERO, POWER),)))
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
    assert written(device)[-1] == QUIET
