"""Simulated time against the wall's."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from otwarp.errors import InputError
from otwarp.teleop.session.pace import LONGEST_DEBT, Pace

STEP = 1e-3
ROUNDING = 1e-9


def test_whole_steps_follow_the_wall():
    pace = Pace(STEP, rate=120.0)
    steps = [pace.due(n / 120.0) for n in range(1, 1201)]
    assert abs(sum(steps) * STEP - 10.0) < 2.0 * STEP
    assert max(steps) - min(steps) <= 1
    assert pace.slipped == 0.0
    assert pace.report().factor == pytest.approx(1.0, abs=0.01)


def test_slow_motion_and_its_range():
    pace = Pace(STEP, rate=120.0, speed=0.25)
    assert abs(sum(pace.due(n / 120.0) for n in range(1, 1201)) * STEP - 2.5) < 2.0 * STEP
    assert pace.report().factor == pytest.approx(0.25, abs=0.005)
    for bad in (0.0, 11.0, float("nan")):
        with pytest.raises(InputError, match=r"speed is .* allowed: 0.01 to 10"):
            pace.set_speed(bad)
    assert pace.speed == 0.25


def test_a_pause_is_no_debt():
    pace = Pace(STEP, rate=120.0)
    pace.due(0.5)
    pace.pause(True, 0.5)
    assert pace.due(3.0) == 0 and pace.report().paused
    pace.pause(False, 5.0)
    assert pace.due(5.01) in (9, 10)
    assert pace.stood == pytest.approx(4.5)


def test_a_restart_within_a_tick_is_no_debt():
    pace = Pace(STEP, rate=120.0)
    pace.due(0.5)
    pace.restart(2.5)  # a reset took two seconds of the tick that began at 0.51
    assert pace.due(0.51) == 0
    assert pace.due(2.51) in (9, 10)
    assert pace.slipped == pytest.approx(0.45)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=60), st.floats(0.01, 10.0))
def test_no_simulated_second_is_lost_without_being_counted(waits, speed):
    pace, now = Pace(STEP, rate=120.0, speed=speed), 0.0
    steps = []
    for wait in waits:
        now += wait
        steps.append(pace.due(now))
    accounted = sum(steps) * STEP + pace.slipped
    # what is not accounted for is still owed, and less than a step or the longest debt
    assert -ROUNDING <= now * speed - accounted <= max(STEP, LONGEST_DEBT * speed) + ROUNDING
    assert max(steps) * STEP <= max(LONGEST_DEBT * speed, STEP) + ROUNDING
    assert pace.simulated == pytest.approx(sum(steps) * STEP)


def test_a_machine_that_is_too_slow_says_so():
    pace = Pace(STEP, rate=120.0)
    for n in range(1, 21):
        pace.due(0.2 * n)  # every tick takes 0.2 s
    report = pace.report()
    assert report.factor == pytest.approx(LONGEST_DEBT / 0.2, rel=0.05)
    assert report.slipped == pytest.approx(4.0 * (1.0 - LONGEST_DEBT / 0.2), rel=0.05)


@pytest.mark.parametrize("cost", [1.1, 2.0, 3.0])
def test_a_machine_that_is_too_slow_takes_short_ticks_where_it_is_told_to(cost):
    """`cost` seconds of work for a simulated second: states come often, time slips, and both are told."""
    pace, now, works = Pace(STEP, rate=120.0, longest_tick=0.014), 0.0, []
    for _ in range(600):
        work = 1e-3 + cost * STEP * pace.due(now)
        pace.worked(work)
        works.append(work)
        now += math.ceil(work * 120.0) / 120.0
    assert max(works[30:]) <= 0.014 + cost * STEP
    assert pace.simulated > 0.7 * 600 * 0.013 / cost
    assert pace.simulated + pace.slipped == pytest.approx(now, abs=LONGEST_DEBT + 0.02)
    assert pace.report().factor == pytest.approx(pace.simulated / now, abs=0.02)


def test_one_slow_tick_is_caught_up():
    pace = Pace(STEP, rate=120.0, longest_tick=0.014)
    steps = []
    for n in range(1, 61):
        steps.append(pace.due(n / 120.0 + (0.03 if n > 20 else 0.0)))
        pace.worked(1e-3 + 3e-4 * steps[-1] + (0.03 if n == 20 else 0.0))
    assert pace.slipped == 0.0
    assert sum(steps) * STEP == pytest.approx(0.53, abs=2e-3)


def test_a_tick_whose_other_work_is_long_still_takes_steps():
    pace = Pace(STEP, rate=120.0, longest_tick=0.014)
    for n in range(1, 121):
        pace.due(n / 60.0)
        pace.worked(0.016)
    assert pace.due(2.1) >= 2
