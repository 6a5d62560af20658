"""Velocities that hold, and a pair that moves as one."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from otwarp.ros.motion import MOST_WAITING, VelocityHold, move_pair

EXACT = 1e-12
"""Relative: a dozen operations on numbers near 1."""


def test_a_velocity_holds_until_the_next():
    held = VelocityHold(timeout=1.0)
    assert held.displacement(0.0) == (0.0, 0.0, 0.0)
    held.message((10.0, 0.0, 0.0), 0.1)
    held.message((0.0, 4.0, 0.0), 0.3)
    assert held.displacement(0.5) == pytest.approx((2.0, 0.8, 0.0), rel=EXACT)
    assert held.displacement(0.6) == pytest.approx((0.0, 0.4, 0.0), rel=EXACT)


def test_a_velocity_ends_with_its_timeout():
    held = VelocityHold(timeout=0.1)
    held.displacement(0.0)
    held.message((1.0, 0.0, 0.0), 0.0)
    assert held.displacement(5.0)[0] == pytest.approx(0.1, rel=EXACT)
    assert held.displacement(6.0) == (0.0, 0.0, 0.0)


def test_before_the_first_reading_nothing_moves():
    held = VelocityHold(timeout=10.0)
    held.message((1.0, 0.0, 0.0), 0.0)
    assert held.displacement(5.0) == (0.0, 0.0, 0.0)
    assert held.displacement(6.0)[0] == pytest.approx(1.0)


@given(
    st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(-5.0, 5.0)), max_size=12),
    st.lists(st.floats(0.0, 4.0), max_size=12),
    st.floats(0.01, 2.0),
)
@settings(max_examples=200, deadline=None)
def test_the_integral_does_not_depend_on_when_it_is_read(messages, readings, timeout):
    """Against the integral of the same steps on a fine list of edges."""
    messages = sorted(messages, key=lambda m: m[0])
    held, total, waiting = VelocityHold(timeout), 0.0, list(messages)
    held.displacement(0.0)
    for now in [*sorted(readings), 4.0]:
        while waiting and waiting[0][0] <= now:
            time, v = waiting.pop(0)
            held.message((v, 0.0, 0.0), time)
        total += held.displacement(now)[0]
    expected = 0.0
    for n, (time, v) in enumerate(messages):
        end = messages[n + 1][0] if n + 1 < len(messages) else 4.0
        expected += v * (min(end, time + timeout) - time)
    assert total == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_velocity_can_be_asked_for_and_forgotten():
    held = VelocityHold(timeout=0.1)
    held.displacement(0.0)
    held.message((1.0, 0.0, 0.0), 0.1)
    assert (held.at(0.05), held.at(0.15), held.at(0.25)) == ((0.0,) * 3, (1.0, 0.0, 0.0), (0.0,) * 3)
    held.displacement(0.12)
    assert held.at(0.15) == (1.0, 0.0, 0.0)
    held.message((2.0, 0.0, 0.0), 0.13)
    held.drop()
    assert held.at(0.15) == (0.0,) * 3 and held.displacement(0.05) == held.displacement(0.2) == (0.0,) * 3
    held.message((3.0, 0.0, 0.0), 0.2)
    assert held.displacement(0.25)[0] == pytest.approx(0.15, rel=EXACT)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 11.0])
def test_speeds_that_no_hand_has_are_refused(bad):
    held = VelocityHold(timeout=1.0, fastest=10.0)
    held.displacement(0.0)
    held.message((0.0, bad, 0.0), 0.0)
    assert held.displacement(1.0) == (0.0, 0.0, 0.0)
    assert held.refused == 1


def test_clocks_that_disagree_move_nothing_backwards():
    held = VelocityHold(timeout=1.0)
    held.displacement(1.0)
    held.message((1.0, 0.0, 0.0), 1.4)  # by the other thread, after `now` was read
    assert held.displacement(1.2) == (0.0, 0.0, 0.0)
    assert held.displacement(1.1) == (0.0, 0.0, 0.0)
    assert held.displacement(1.5)[0] == pytest.approx(0.3)


def test_what_waits_is_bounded():
    held = VelocityHold(timeout=1.0)
    held.displacement(0.0)
    for n in range(3 * MOST_WAITING):
        held.message((1.0, 0.0, 0.0), n * 1e-4)
    assert len(held._waiting) == MOST_WAITING
    assert math.isfinite(held.displacement(3.0)[0])


def test_the_pair_moves_as_one_about_its_midpoint():
    first = [(1.0, 0.0, 1.0), (3.0, 0.0, 2.0)]
    second = [(-2.0, 0.0, 3.0)]
    moved = move_pair(first, second, (10.0, 20.0), math.pi / 2.0)
    # the centroids are at 2 and −2: a quarter turn about the origin, then the shift
    assert moved[0][0] == pytest.approx((10.0, 21.0, 1.0), abs=EXACT)
    assert moved[0][1] == pytest.approx((10.0, 23.0, 2.0), abs=EXACT)
    assert moved[1][0] == pytest.approx((10.0, 18.0, 3.0), abs=EXACT)
    assert move_pair(first, second, (0.0, 0.0), 0.0) == (first, second)
