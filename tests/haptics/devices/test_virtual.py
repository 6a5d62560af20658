from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from otwarp.errors import InputError
from otwarp.haptics.core import Device, DeviceLost
from otwarp.haptics.core.shared_memory import Mailbox
from otwarp.haptics.devices import KINDS, Kind, create_device, parse_devices
from otwarp.haptics.devices.mouse import POINTER, SILENCE, MouseDevice
from otwarp.haptics.devices.virtual import HandModel, VirtualDevice, advance

EXACT = 1e-9
"""Relative: two ways to evaluate the same matrix exponential, of numbers up to 1e3."""


def virtual(text: str) -> VirtualDevice:
    (spec,) = parse_devices([f"virtual:{text}"])
    device = create_device(spec)
    assert isinstance(device, Device)
    device.open()
    return device


@given(
    x=st.floats(-0.1, 0.1),
    v=st.floats(-1.0, 1.0),
    push=st.floats(-5.0, 5.0),
    mass=st.floats(0.01, 2.0),
    damping=st.sampled_from([0.0, 0.2, 3.0, 40.0]),
    stiffness=st.sampled_from([0.0, 1.0, 300.0, 5000.0]),
    dt=st.floats(1e-4, 0.05),
)
@settings(max_examples=200, deadline=None)
def test_the_hand_is_advanced_exactly(x, v, push, mass, damping, stiffness, dt):
    matrix = np.array([[0, 1, 0], [-stiffness / mass, -damping / mass, push / mass], [0, 0, 0]])
    expected = expm(matrix * dt) @ [x, v, 1.0]
    got = advance(x, v, push, mass, damping, stiffness, dt)
    scale = 1.0 + abs(push) / mass
    np.testing.assert_allclose(got, expected[:2], rtol=EXACT, atol=EXACT * scale)


def test_a_critical_grip_is_advanced_like_its_neighbours():
    mass, stiffness = 0.15, 300.0
    critical = 2.0 * math.sqrt(mass * stiffness)
    near = [advance(0.01, 0.1, 0.5, mass, critical * s, stiffness, 0.01) for s in (1 - 1e-6, 1.0, 1 + 1e-6)]
    for component in zip(*near, strict=True):
        assert component[1] == pytest.approx(0.5 * (component[0] + component[2]), rel=1e-9)


def test_a_free_device_under_a_force_gains_the_work_done_on_it():
    device = virtual("hold,grip=0,damping=0,mass=0.2")
    x0, work, force = device.read(0.0).position[0], 0.0, 0.7
    for k in range(1, 500):
        device.write((force, 0.0, 0.0))
        x1 = device.read(0.001 * k).position[0]
        work, x0 = work + force * (x1 - x0), x1
    assert 0.5 * 0.2 * device._velocity[0] ** 2 == pytest.approx(work, rel=1e-9)


@pytest.mark.parametrize(("stiffness", "stable"), [(380.0, True), (440.0, False)])
def test_a_bare_device_renders_springs_up_to_2b_over_T(stiffness, stable):
    """0.15 kg, 0.2 N·s/m at 1 kHz: passive below 2b/T = 400 N/m (J. E. Colgate, G. G. Schenkel, J. Robotic
    Systems 14(1), 37–47, 1997), unstable from 414 N/m on."""
    device = virtual("hold,grip=0")
    device.read(0.0)
    device._velocity = (0.05, 0.0, 0.0)
    reach = []
    for k in range(1, 20_000):
        x = device.read(0.001 * k).position[0]
        reach.append(abs(x))
        device.write((-stiffness * x, 0.0, 0.0))
    assert (max(reach[-1000:]) < max(reach[:1000])) == stable


def test_a_held_hand_gives_way_by_force_over_grip_and_follows_slowly_moving_paths():
    device = virtual("hold,at=0.01/0.02/0,grip=200")
    for k in range(3000):
        x, y, z = device.read(0.001 * k).position
        device.write((0.5, 0.0, -1.0))
    assert (x, y, z) == pytest.approx((0.01 + 0.5 / 200, 0.02, -1.0 / 200), abs=1e-9)
    moving = virtual("line,from=0/0/0,to=0.1/0/0,duration=2,damping=0,grip=300")
    for k in range(1500):
        x = moving.read(0.001 * k).position[0]
    assert x == pytest.approx(0.05 * 1.499, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "time", "expected"),
    [
        ("hold,at=0.01/-0.02/0.03", 1.0, (0.01, -0.02, 0.03)),
        ("line,from=0/0/0,to=0.1/0.2/-0.1,duration=4", 1.0, (0.025, 0.05, -0.025)),
        ("line,to=0.1/0/0,duration=1", 7.0, (0.1, 0.0, 0.0)),
        ("circle,radius=0.02,period=4", 1.0, (-0.02, 0.02, 0.0)),
        ("circle,radius=0.02,period=4,plane=yz,at=0/0.01/0", 2.0, (0.0, -0.03, 0.0)),
        ("sine,amplitude=0.03,frequency=0.25,axis=z", 1.0, (0.0, 0.0, 0.03)),
    ],
)
def test_scripts_go_where_they_say(text, time, expected):
    device = virtual(text + ",mass=0,buttons=3")
    start = 100.0  # scripts begin when they are first read
    device.read(start)
    device.write((3.0, 0.0, 0.0))  # a hand without mass does not give way
    sample = device.read(start + time)
    assert sample.position == pytest.approx(expected, abs=1e-15)
    assert (sample.buttons, sample.fresh, sample.time) == (3, True, start + time)


def test_limits_are_told_and_a_closed_device_is_lost():
    device = virtual("hold,force=2,continuous=0.5")
    assert (device.info.force, device.info.continuous_force, device.info.kind) == (2.0, 0.5, "virtual")
    device.close()
    device.close()
    with pytest.raises(DeviceLost):
        device.read(0.0)
    with pytest.raises(DeviceLost):
        device.write((0.0, 0.0, 0.0))
    device.open()
    assert device.read(1.0).position == (0.0, 0.0, 0.0)
    assert HandModel(grip=300.0, mass=0.15).held_damping == pytest.approx(2 * math.sqrt(45.0))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("square", "script 'square' must be one of hold, line, circle, sine"),
        ("circle,radius=2", "radius = 2 must be a number from 0 to 1"),
        ("circle,radius=nan", "radius = nan"),
        ("circle,radius=big", "radius = big"),
        ("circle,radius", "'radius' must be one of"),
        ("circle,period=1,period=2", "each once"),
        ("hold,radius=0.01", "'radius=0.01' must be one of at, mass"),
        ("hold,at=0/0", "at = 0/0 must be x/y/z"),
        ("hold,at=0/0/2", "within ±1"),
        ("hold,at=0/nan/0", "within ±1"),
        ("circle,plane=xx", "plane = 'xx' must be one of xy, yz, zx"),
        ("sine,axis=w", "axis = 'w'"),
        ("hold,mass=-1", "mass = -1"),
    ],
)
def test_bad_scripts_are_one_clear_line(text, says):
    with pytest.raises(InputError, match=says.replace("(", r"\(")) as error:
        virtual(text)
    assert "\n" not in str(error.value)
    assert f"virtual:{text}" in str(error.value)


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        (["teapot"], "unknown kind 'teapot'; must be one of box, .*mouse, .*replay, .*virtual"),
        ([""], "unknown kind ''; must"),
        (["spacemous"], r"unknown kind 'spacemous' \(did you mean spacemouse\?\); must be one of box, "),
        (["Mouse"], r"unknown kind 'Mouse' \(did you mean mouse\?\)"),
        (["virtual"], "must be virtual:<a script"),
        (["replay:"], "must be replay:<a recording"),
        (["mouse:left"], "mouse takes nothing after it"),
        ([], "1 to 2"),
        (["mouse"] * 3, "1 to 2"),
        (["box:A", "box:A"], "both hands name it"),
        (["box:A", "box"], "name both or neither"),
        (["box", 'box:"A"'], "name both or neither"),
    ],
)
def test_bad_device_names_are_one_clear_line(monkeypatch, texts, says):
    monkeypatch.setitem(KINDS, "box", Kind("nowhere:create", "optional", "its serial number", False))
    with pytest.raises(InputError, match=says) as error:
        parse_devices(texts)
    assert "\n" not in str(error.value)


def test_two_of_a_kind_are_told_apart(monkeypatch):
    monkeypatch.setitem(KINDS, "box", Kind("nowhere:create", "optional", "its serial number", False))
    first, second = parse_devices(["box", "box"])
    assert (first.ordinal, second.ordinal, second.hand) == (0, 1, 1)
    left, right = parse_devices(['box:"Left Touch"', "box:'Right Touch'"])
    assert (left.argument, right.argument, right.ordinal) == ("Left Touch", "Right Touch", 0)
    same = parse_devices(["virtual:hold", "virtual:hold"])
    assert create_device(same[0]) is not create_device(same[1])


@pytest.fixture
def mouse():
    with Mailbox.create(POINTER) as page:
        (spec,) = parse_devices(["mouse"], [page.name])
        device = create_device(spec)
        assert isinstance(device, Device)
        device.open()
        yield device, page
        device.close()


def test_a_mouse_goes_to_the_pointer_no_faster_than_its_speed(mouse):
    device, page = mouse
    assert device.read(0.0).position == (0.0, 0.0, 0.0)
    assert not device.read(0.0).fresh  # the page has not spoken
    page.write((0.03, 0.04, 0.0, 5))
    last = device.read(0.001)
    for k in range(2, 60):
        sample = device.read(0.001 * k)
        assert math.dist(sample.position, last.position) <= 0.5 * 0.001 * (1 + 1e-9)
        last = sample
    assert last.position == pytest.approx((0.03 * 59 / 100, 0.04 * 59 / 100, 0.0))
    assert (last.buttons, last.fresh) == (5, True)
    for k in range(60, 110):
        last = device.read(0.001 * k)
    assert last.position == (0.03, 0.04, 0.0)


def test_a_page_that_is_gone_holds_no_button(mouse):
    device, page = mouse
    page.write((0.0, 0.0, 0.0, 1))
    assert device.read(1.0).buttons == 1
    assert device.read(1.0 + 0.9 * SILENCE).buttons == 1
    late = device.read(1.0 + 1.1 * SILENCE)
    assert (late.buttons, late.fresh) == (0, False)
    page.write((0.0, 0.0, 0.0, 1))
    assert device.read(2.0).buttons == 1


def test_a_pointer_that_is_no_place_is_ignored_and_a_long_pause_is_no_jump(mouse):
    device, page = mouse
    page.write((0.01, 0.0, 0.0, 1))
    for k in range(40):
        device.read(0.001 * k)
    page.write((float("nan"), 0.0, 0.0, 1))
    assert device.read(0.1).position == (0.01, 0.0, 0.0)
    page.write((0.9, 0.0, 0.0, 1))
    assert device.read(60.0).position[0] == pytest.approx(0.01 + 0.5 * 0.1)


def test_a_mouse_needs_a_page_and_a_sensible_speed(mouse):
    device, page = mouse
    for speed in (0.0, -1.0, float("nan"), 1e9):
        with pytest.raises(InputError, match="speed"):
            MouseDevice(page.name, speed=speed)
    (alone,) = parse_devices(["mouse"])
    with pytest.raises(InputError, match="hand 0 has no pointer mailbox"):
        create_device(alone)
    device.close()
    with pytest.raises(DeviceLost):
        device.read(0.0)
    with pytest.raises(InputError, match="is its creator running"):
        MouseDevice("otwarp_no_such_page").open()
