"""Z-width of a bare 0.15 kg, 0.2 N·s/m device on a virtual clock."""

from __future__ import annotations

import pytest

from otwarp.haptics.check.zwidth import (
    BARE,
    PASSIVE,
    UNLIMITED,
    BareDevice,
    Release,
    chain_renderer,
    chain_width,
    paper_width,
    speeds,
)
from otwarp.haptics.core.config import (
    TOUCH_DAMPING,
    TOUCH_MASS,
    TOUCH_QUANTUM,
    ChainConfig,
    CouplingConfig,
    LowPass,
    SafetyConfig,
)

PERIOD = 1e-3

SAMPLED = 0.005
"""Relative: the exact border of the sampled loop is 2b/T·(1 + bT/6m), 400.09 N/m, and the bisection ends within 2e-4;
what is left is how slowly a vibration grows near it."""

PAPER = 0.035
"""Relative, of figures given with two digits: 10.3 and 1.4 N/m are themselves rounded by 0.5 % and 3.6 %."""

STIFF = 10_000.0


def test_device_is_that_of_the_presets():
    assert (BareDevice().mass, BareDevice().damping) == (TOUCH_MASS, TOUCH_DAMPING)


def test_device_moves_as_its_equation_says():
    """Two half periods are a whole one; the terminal speed is F/b."""
    device = BareDevice()
    half = device.advance(*device.advance(0.01, 0.2, 1.5, 0.05), 1.5, 0.05)
    assert half == pytest.approx(device.advance(0.01, 0.2, 1.5, 0.1), rel=1e-12)
    assert device.advance(0.0, 0.0, 1.0, 100.0)[1] == pytest.approx(5.0)


@pytest.mark.parametrize("wall", [False, True])
def test_without_control_it_is_two_b_over_t(wall):
    found = chain_width(BARE, wall=wall, high=2000.0)
    assert found >= 2.0 * TOUCH_DAMPING / PERIOD * (1.0 - 2e-4)
    assert found == pytest.approx(2.0 * TOUCH_DAMPING / PERIOD, rel=SAMPLED)


@pytest.mark.parametrize("wall", [False, True])
@pytest.mark.parametrize("safety", [UNLIMITED, SafetyConfig(ramp_time=0.0)])
def test_with_control_ten_thousand_and_more(wall, safety):
    """With safety out of the way, and with the Touch's slew limit, clamp and guard."""
    assert chain_width(PASSIVE, wall=wall, safety=safety, high=STIFF) == STIFF


@pytest.mark.parametrize("stiffness", [1000.0, 3000.0, STIFF, 20_000.0])
@pytest.mark.parametrize("wall", [False, True])
def test_with_control_vibrations_die_as_the_device_damps_them(stiffness, wall):
    """Not merely bounded: within 3 s the device's own b/2m leaves less than a half; 0.14 of it on a spring."""
    start = 0.0 if wall else -0.5 / stiffness
    render = chain_renderer(PASSIVE, start=start, stiffness=stiffness, wall=wall, safety=UNLIMITED)
    found = speeds(BareDevice(), render, start=start, rate=1000.0, duration=4.0, press=0.5 * wall)
    assert found[3] < 0.5 * found[0]


@pytest.mark.parametrize("wall", [False, True])
def test_with_control_and_a_real_encoder_it_is_bounded(wall):
    """55 µm at 10 kN/m are steps of 0.55 N: a vibration of that size stays, and does not grow."""
    chain = ChainConfig(quantum=TOUCH_QUANTUM)
    device = BareDevice(quantum=TOUCH_QUANTUM)
    assert chain_width(chain, device=device, wall=wall, safety=SafetyConfig(ramp_time=0.0), high=STIFF) == STIFF


def test_virtual_coupling_bounds_what_an_uncontrolled_loop_renders():
    """Behind 300 N/m a wall of 10 kN/m is felt as 291, below 2b/T: stable without any control."""
    coupled = ChainConfig(passivity=None, coupling=CouplingConfig(stiffness=300.0, damping=20.0))
    start = -0.5 / 291.0
    render = chain_renderer(coupled, start=start, stiffness=STIFF, wall=False, safety=UNLIMITED)
    found = speeds(BareDevice(), render, start=start, rate=1000.0, duration=4.0)
    bare = chain_renderer(BARE, start=start, stiffness=STIFF, wall=False, safety=UNLIMITED)
    assert found[3] < 0.5 * found[0]
    assert speeds(BareDevice(), bare, start=start, rate=1000.0, duration=0.2)[3] > 1.0


@pytest.mark.quick
def test_paper_mode_at_servo_rate():
    """b/τ for α = 0.05 at 1 kHz."""
    assert paper_width(rate=1000.0, release=Release(duration=20.0)) == pytest.approx(10.3, rel=PAPER)


def test_paper_mode_as_released():
    """120 messages a second, 5 ms late."""
    assert paper_width(rate=120.0, delay=0.005) == pytest.approx(1.4, rel=PAPER)


def test_a_force_filter_costs_our_chain_as_much_without_control():
    filtered = ChainConfig(passivity=None, force_filter=LowPass(alpha=0.05, rate=1000.0))
    assert chain_width(filtered, release=Release(duration=8.0), high=40.0) == pytest.approx(10.3, rel=PAPER)
