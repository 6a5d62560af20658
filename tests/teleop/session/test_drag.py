"""The drag of an even motion is what is read out and what is felt; benchmarks/teleop.py has the table, with noise."""

from __future__ import annotations

import pytest

from benchmarks.teleop import LEAP, SLOW_TICK, drag

CLOSE = 0.05
"""Of γv: parts of 1 ms with a relaxation time of 1.68 ms leave 1 + (1/1.68)²/12 = 1.03."""

LOST = 0.1
"""Of γv: with leaps about 8.3 ms of relaxation have passed when the force is read, e^(−5)·8.3/1.68 = 0.036."""


@pytest.mark.thorough
def test_a_hand_feels_the_drag_and_not_the_age_of_the_state():
    found = drag()
    assert found.read[0] == pytest.approx(1.0, abs=CLOSE) and found.felt[0] == pytest.approx(1.0, abs=CLOSE)
    # states of 8 and of 9 servo periods alternate
    assert found.read[1] < 0.1 and found.felt[1] < 0.1
    slow = drag(work=SLOW_TICK)
    assert slow.felt[0] == pytest.approx(1.0, abs=CLOSE) and slow.felt[1] < 0.1


def test_frozen_spheres_add_what_the_trap_went_since():
    # k·v·T/2 more, T = 1/120 s and half a servo period at each end
    assert drag(prediction=False).felt[0] == pytest.approx(1.0 + 10.0 * 5.0 / 2 * (1 / 120 + 1e-3) / 0.0839, abs=0.15)


def test_leaps_lose_the_drag():
    found = drag(glide=LEAP)
    assert 0.0 < found.read[0] < LOST and 0.0 < found.felt[0] < LOST
