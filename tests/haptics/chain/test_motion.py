"""Velocity estimate, and what the hand's motion does to its traps."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from otwarp.haptics.chain.motion import LONGEST_WINDOW, Motion, VelocityEstimate
from otwarp.haptics.core.config import IDENTITY, LowPass
from tests.haptics.setups import PERIOD, drive, hand_config, make_chain, scene_at

QUANTUM = 5.5e-5
"""Resolution of a Touch [m]."""


def estimates(position, steps: int, quantum: float, rounded: float = 0.0) -> list[float]:
    estimate = VelocityEstimate(PERIOD, quantum)
    out = []
    for n in range(steps):
        x = position(n * PERIOD)
        x = round(x / rounded) * rounded if rounded else x
        out.append(estimate.step(x, 0.0, -x)[0])
    return out


def test_even_motion_is_exact_at_once():
    found = estimates(lambda t: 0.3 * t, 10, 0.0)
    assert found[1:] == pytest.approx([0.3] * 9, rel=1e-12)


def test_window_quiets_a_coarse_encoder():
    """At 20 mm/s a difference of two samples is off by up to the quantum over a period; the window by its 15th part."""
    steady = slice(3 * LONGEST_WINDOW, None)

    def worst(quantum: float) -> float:
        return max(abs(v - 0.02) for v in estimates(lambda t: 0.02 * t, 400, quantum, QUANTUM)[steady])

    assert worst(0.0) > 0.5 * QUANTUM / PERIOD
    assert worst(QUANTUM) <= 1.01 * QUANTUM / (LONGEST_WINDOW * PERIOD)


def test_window_lets_go_when_the_hand_turns():
    """A blow to a hand at 0.2 m/s is seen within two periods."""
    found = estimates(lambda t: 0.2 * t if t < 0.05 else 0.01 - 0.2 * (t - 0.05), 60, QUANTUM, QUANTUM)
    assert found[48] == pytest.approx(0.2, rel=0.1)
    assert found[52] < -0.1


def test_gain_and_axes():
    """Device x, y, z (right, up, to the user) → scene x, z, −y, by the gain."""
    motion = Motion(hand_config(motion_gain=200.0))
    motion.step(0.01, 0.02, 0.03, True)
    assert motion.carried == (0.0, 0.0, 0.0)
    assert motion.step(0.02, 0.04, 0.06, True) == pytest.approx((2.0, -6.0, 4.0))


def test_clutch_lets_go_and_takes_hold_without_a_jump():
    chain = make_chain(hand_config(axis_map=IDENTITY))
    run = drive(chain, lambda t: (0.1 * t, 0.0, 0.0), 300, buttons=lambda n: 2 if 100 <= n < 200 else 0)
    x = [now.traps[0][1][0] for now in run]
    assert x[99] == pytest.approx(0.99)
    assert x[199] == x[99]
    assert x[299] == pytest.approx(x[99] + 1.0)
    assert max(b - a for a, b in pairwise(x)) <= 0.01 * (1.0 + 1e-9)


def test_without_a_clutch_its_button_does_nothing():
    chain = make_chain(hand_config(clutch=False, axis_map=IDENTITY))
    run = drive(chain, lambda t: (0.1 * t, 0.0, 0.0), 100, buttons=lambda n: 2)
    assert run[-1].traps[0][1][0] == pytest.approx(0.99)


def test_absolute_follows_the_place():
    """After the clutch the trap is where the hand is, not where the motions add up to."""
    chain = make_chain(hand_config(absolute=True, axis_map=IDENTITY))
    run = drive(chain, lambda t: (0.1 * t, 0.0, 0.0), 200, buttons=lambda n: 2 if n < 100 else 0)
    assert run[-1].traps[0][1][0] == pytest.approx(1.99)


def test_dead_man_holds_the_traps_too():
    chain = make_chain(hand_config(dead_man=True, axis_map=IDENTITY))
    run = drive(chain, lambda t: (0.1 * t, 0.0, 0.0), 100, buttons=lambda n: 1 if n >= 50 else 0)
    assert run[49].traps[0][1][0] == 0.0
    assert run[-1].traps[0][1][0] == pytest.approx(0.5)


def test_trap_speed_is_limited():
    motion = Motion(hand_config(trap_speed=5.0, motion_gain=100.0))
    for n in range(101):
        motion.step(0.01 * n, 0.0, 0.01 * n, True)
    assert math.dist(motion.carried, (0.0, 0.0, 0.0)) == pytest.approx(5.0 * 0.1)


def test_motion_filter_delays_the_command_and_not_the_force():
    """On a ramp the command lags by v·(τ-like) T(1 − α)/α; the place that the force is evaluated at does not."""
    alpha = 0.05
    config = hand_config(motion_filter=LowPass(alpha=alpha, rate=1000.0), axis_map=IDENTITY)
    motion = Motion(config)
    for n in range(1000):
        motion.step(1e-4 * n, 0.0, 0.0, True)
    assert motion.carried[0] == pytest.approx(9.99)
    assert motion.carried[0] - motion.commanded[0] == pytest.approx(0.01 * (1.0 - alpha) / alpha, rel=1e-6)


def test_takes_hold_anew_when_the_simulation_is_reset():
    """Simulated time that jumps back means traps that jumped; the hand carries them from where they are now."""
    chain = make_chain(hand_config(axis_map=IDENTITY))
    drive(chain, lambda t: (0.1 * t, 0.0, 0.0), 100)
    (now,) = drive(
        chain, lambda t: (0.1 * t, 0.0, 0.0), 1, start=100, scene=lambda n, t: scene_at(n, 0.0, trap=(5.0, 0.0, 0.0))
    )
    assert now.traps == ((0, (5.0, 0.0, 0.0)),)


def carried(motion: Motion, places, holds=lambda n: True):
    return [motion.step(x, 0.0, 0.0, holds(n)) for n, x in enumerate(places)]


@pytest.mark.parametrize("absolute", [False, True])
def test_another_gain_moves_no_trap_and_scales_what_comes(absolute):
    motion = Motion(hand_config(axis_map=IDENTITY, absolute=absolute, motion_gain=100.0))
    before = carried(motion, [0.0, 0.01, 0.02])[-1]
    motion.set_gain(400.0)
    assert motion.step(0.02, 0.0, 0.0, True) == before == (2.0, 0.0, 0.0)
    assert motion.step(0.03, 0.0, 0.0, True)[0] == pytest.approx(6.0, rel=1e-12)
    motion.set_gain(100.0)
    assert motion.step(0.0, 0.0, 0.0, True)[0] == pytest.approx(3.0, rel=1e-12)


def test_a_gain_set_while_the_clutch_is_held_leaves_an_absolute_trap_to_come_to_the_hand():
    motion = Motion(hand_config(axis_map=IDENTITY, absolute=True, motion_gain=100.0))
    motion.step(0.0, 0.0, 0.0, True)
    assert carried(motion, [0.01, 0.03], lambda n: False)[-1] == (0.0, 0.0, 0.0)
    motion.set_gain(200.0)
    assert motion.step(0.03, 0.0, 0.0, False) == (0.0, 0.0, 0.0)
    # the place of the hand is worth what it was when the gain changed
    assert motion.step(0.03, 0.0, 0.0, True)[0] == pytest.approx(3.0, rel=1e-12)
    assert motion.step(0.04, 0.0, 0.0, True)[0] == pytest.approx(5.0, rel=1e-12)


def test_a_gain_set_before_anything_was_held_counts_from_the_start():
    motion = Motion(hand_config(axis_map=IDENTITY, absolute=True, motion_gain=100.0))
    motion.set_gain(50.0)
    assert carried(motion, [0.5, 0.51])[-1][0] == pytest.approx(0.5, rel=1e-12)
