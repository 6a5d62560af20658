"""Energy: the chain never gives back more than it took, whatever delays, drops and jumps the scene makes."""

from __future__ import annotations

import math

import pytest

from otwarp.haptics.chain.passivity import HELD, LONGEST, Passivity, stiffest
from otwarp.haptics.core.config import PassivityConfig
from otwarp.haptics.devices import exchange
from tests.haptics.setups import PERIOD, drive, energy_of, hand_config, make_chain, scene_at

RESERVE = PassivityConfig().reserve

EPSILON = RESERVE
"""On time, and with motion within what is foreseen, nothing comes on top."""


@pytest.mark.parametrize("delay", [0.0, 0.005, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("drop", [0.0, 0.3])
@pytest.mark.parametrize(("gain", "speed", "quantum"), [(0.05, 0.1, 0.0), (0.5, 0.05, 5.5e-5)])
def test_passive_under_delay_drops_and_contact_switching(delay, drop, gain, speed, quantum):
    """60 and 600 N/m of rendered stiffness; energy counted outside the chain."""
    least, most, gap = energy_of(seed=0, delay=delay, drop=drop, speed=speed, gain=gain, quantum=quantum)
    assert least >= -EPSILON
    assert most > 3.0 * EPSILON  # something was rendered
    assert gap <= 1e-12  # the observer never believes in more than there is; above its capacity it forgets


def test_without_control_the_same_scene_is_active():
    least, _, _ = energy_of(seed=0, delay=0.1, drop=0.0, speed=0.1, gain=0.05, quantum=0.0, passivity=False)
    assert least < -45.0 * EPSILON


def test_observer_counts_the_work_of_a_held_force():
    """Whatever the time between; what is held counts, not what was asked for."""
    passivity = Passivity(PassivityConfig(capacity=10.0, noise=0.0), PERIOD)
    passivity.send((9.0, 9.0, 9.0))
    passivity.observe(0.0, 0.0, 0.0, PERIOD)  # no motion yet
    passivity.send((-2.0, 5.0, 0.0))
    assert passivity.observe(0.1, 0.0, 0.0, PERIOD) == pytest.approx(0.2)
    assert passivity.observe(0.0, 0.0, 0.0, 8.0 * PERIOD) == pytest.approx(0.0)
    passivity.send((0.0, 0.0, 1.0))
    assert passivity.observe(0.0, 0.0, -0.3, 1e-4) == pytest.approx(0.3)


def test_capacity_is_the_most_that_is_remembered():
    passivity = Passivity(PassivityConfig(capacity=0.05), PERIOD)
    passivity.observe(0.0, 0.0, 0.0, PERIOD)
    passivity.send((-1.0, 0.0, 0.0))
    assert passivity.observe(1.0, 0.0, 0.0, PERIOD) == 0.05


def test_control_takes_only_what_is_active_and_along_the_motion():
    passivity = Passivity(PassivityConfig(reserve=0.0), 1e-3)
    dissipative = (-1.0, 0.5, 0.0)
    assert passivity.control(dissipative, (0.1, 0.0, 0.0)) == dissipative
    # a push along the motion, with nothing in store: gone; across it: untouched
    assert passivity.control((1.0, 0.5, 0.0), (0.1, 0.0, 0.0)) == pytest.approx((0.0, 0.5, 0.0))
    assert passivity.control((1.0, 0.5, 0.0), (0.0, 0.0, 0.0)) == (1.0, 0.5, 0.0)


def test_damping_that_wins_back_is_limited():
    config = PassivityConfig(reserve=0.0, damping_limit=30.0)
    passivity = Passivity(config, 1e-3)
    passivity.energy = -1.0
    assert passivity.control((1.0, 0.0, 0.0), (0.1, 0.0, 0.0)) == pytest.approx((-3.0, 0.0, 0.0))


def test_a_spring_out_and_back_is_untouched():
    """Slowly along a real spring nothing is taken away: what comes back is what went in, less rounding."""
    run, free = (
        drive(chain, lambda t: (0.004 * math.sin(math.pi * t), 0.0, 0.0), 1000)
        for chain in (make_chain(hand_config(ramp_time=0.0, passivity=p)) for p in (PassivityConfig(), None))
        if chain.arm() is None
    )
    assert max(math.dist(a.force, b.force) for a, b in zip(run, free, strict=True)) == 0.0
    assert abs(run[-1].energy) < 0.02 * max(now.energy for now in run)


def test_a_sphere_that_pushes_a_hand_that_gives_way_finds_no_energy():
    """The sphere runs away and the hand follows its pull: the force along the motion dies with the reserve."""
    chain = make_chain(hand_config(ramp_time=0.0))
    chain.arm()
    run = drive(
        chain, lambda t: (0.02 * t, 0.0, 0.0), 1500, scene=lambda n, t: scene_at(n, t, (2.0 * t + 0.4, 0.0, 0.0))
    )
    assert max(now.force[0] for now in run[:100]) > 0.1
    assert run[-1].force[0] < 0.01
    assert run[-1].energy >= -EPSILON


@pytest.mark.parametrize("hold", [0.0, 8e-3])
def test_a_slow_spring_is_rendered_as_it_is_up_to_the_stiffness_that_is_stated(hold):
    """To 3 N at 1 mm/s; beyond, the force is less where it asks for most of what the hand gave."""
    config = PassivityConfig(hold=hold)
    most = stiffest(config, PERIOD, hold or PERIOD)

    def lost(stiffness: float) -> float:
        passivity, x, largest = Passivity(config, PERIOD), 0.0, 0.0
        while stiffness * x < 3.0:
            passivity.observe(x, 0.0, 0.0, PERIOD)
            force = passivity.bound((-stiffness * x, 0.0, 0.0))
            passivity.send(force)
            largest = max(largest, stiffness * x + force[0])
            x += min(1e-6, 0.01 / stiffness)
        return largest

    assert lost(0.97 * most) == 0.0
    assert lost(1.2 * most) > 0.0


def test_what_a_driver_lets_fall_wins_nothing():
    """A late servo's force falls at the driver (`exchange.share`). A hand that presses on only then works against less
    than the servo's last force; counted in full, it would take the difference back, 0.3 mJ here."""
    passivity = Passivity(PassivityConfig(hold=LONGEST), PERIOD)
    passivity.observe(0.0, 0.0, 0.0, PERIOD)
    late, press = 0.095, 0.02
    assert HELD == exchange.HOLD and late < exchange.GONE
    x = taken = 0.0

    def sent() -> float:
        force = passivity.bound((1.0, 0.0, 0.0))
        passivity.send(force)
        return force[0]

    for _ in range(20):
        x -= 0.5 * press
        taken -= sent() * exchange.share(late - 0.5 * press) * 0.5 * press
        passivity.observe(x, 0.0, 0.0, late)
        for _ in range(round(press / PERIOD)):
            x += 0.5 * PERIOD
            taken += sent() * 0.5 * PERIOD
            passivity.observe(x, 0.0, 0.0, PERIOD)
    assert taken <= PassivityConfig().reserve
