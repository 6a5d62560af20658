"""Gentle moves, without a simulation: what is commanded after so much simulated time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Track
from otwarp.teleop.operators.hands import GENTLE, TrapCommands
from tests.teleop.scenes import PLACES, three_beads, trap

LEFT, RIGHT, NONE = (PLACES[name] for name in ("left", "right", "none"))
TICK = 1.0 / 120.0
ROUNDING = 1e-12
"""Of sums of about a hundred doubles of size 10."""


def away(place: tuple[float, float, float], x: float = 0.0, y: float = 0.0) -> tuple[float, float, float]:
    return place[0] + x, place[1] + y, place[2]


def commands(**changes) -> TrapCommands:
    """Of three traps, the second of which a hand may hold; `changes` to the third."""
    return TrapCommands(replace(three_beads(), traps=(trap("left"), trap("right"), trap("none", **changes))), [1])


def test_a_gentle_move_sets_out_with_simulated_time_and_keeps_to_the_limit():
    traps = commands()
    goal = away(LEFT, 4.0, -3.0)
    traps.move({0: goal}, gently=True)
    traps.advance(0.0)  # a pause, or a tick of slow motion without a step
    assert tuple(traps.position[0]) == LEFT and traps.goals == {0: goal}
    ticks = 0
    while traps.goals:
        before = traps.position[0].copy()
        traps.advance(TICK)
        assert math.dist(before, traps.position[0]) <= GENTLE * TICK + ROUNDING
        ticks += 1
    assert tuple(traps.position[0]) == goal and ticks == math.ceil(5.0 / (GENTLE * TICK))
    assert tuple(traps.position[1]) == RIGHT and tuple(traps.position[2]) == NONE
    traps.advance(TICK)
    assert tuple(traps.position[0]) == goal


def test_a_move_that_is_not_gentle_is_there_at_once():
    traps = commands()
    traps.move({0: away(LEFT, 4.0)})
    assert tuple(traps.position[0]) == away(LEFT, 4.0) and traps.goals == {}


def test_the_last_goal_counts():
    traps = commands()
    for x in (1.0, 2.0, 50.0, -6.0):
        traps.move({0: away(LEFT, x)}, gently=True)
    traps.advance(0.1)
    assert traps.position[0] == pytest.approx(away(LEFT, -0.1 * GENTLE), abs=ROUNDING)


@pytest.mark.parametrize(("own", "limit"), [(5.0, 5.0), (1000.0, GENTLE)])
def test_a_trap_with_a_limit_of_its_own_keeps_to_the_lower(own, limit):
    traps = commands(speed_limit=own)
    traps.move({2: away(NONE, 20.0)}, gently=True)
    traps.advance(0.1)
    assert traps.position[2] == pytest.approx(away(NONE, 0.1 * limit), abs=ROUNDING)


def test_traps_of_one_move_keep_in_step():
    """Else what they hold together would be torn: the slowest sets the pace, and they arrive at the same time."""
    traps = commands(speed_limit=5.0)
    traps.move({0: away(LEFT, 0.0, 6.0), 2: away(NONE, 0.0, 6.0)}, gently=True)
    traps.advance(0.6)
    assert traps.position[[0, 2]] == pytest.approx(np.array([away(LEFT, 0.0, 3.0), away(NONE, 0.0, 3.0)]), abs=ROUNDING)
    # one that is sent elsewhere leaves the others theirs
    traps.move({2: away(NONE)}, gently=True)
    traps.advance(0.1)
    assert tuple(traps.position[0]) == away(LEFT, 0.0, 6.0) and traps.goals == {2: NONE}
    assert traps.position[2] == pytest.approx(away(NONE, 0.0, 2.5), abs=ROUNDING)


@pytest.mark.parametrize(
    ("drop", "place"),
    [
        (lambda traps: traps.move({1: away(RIGHT, -1.0)}), away(RIGHT, -1.0)),
        (lambda traps: traps.shift([1], (0.0, 1.0, 0.0)), away(RIGHT, 3.0, 1.0)),
        (lambda traps: traps.hold([(1, away(RIGHT, 2.5))]), away(RIGHT, 2.5)),
        (lambda traps: traps.restart(), RIGHT),
    ],
    ids=["move", "shift", "hand", "reset"],
)
def test_whoever_moves_the_trap_next_ends_its_way(drop, place):
    traps = commands()
    traps.move({0: away(LEFT, 9.0), 1: away(RIGHT, 9.0)}, gently=True)
    traps.advance(0.1)
    drop(traps)
    assert 1 not in traps.goals
    traps.advance(0.1)
    assert traps.position[1] == pytest.approx(place, abs=ROUNDING)


def test_a_trap_that_a_hand_holds_stays_with_it():
    traps = commands()
    traps.hold([(1, RIGHT)])
    traps.move({1: away(RIGHT, 4.0)}, gently=True)
    assert traps.goals == {}
    traps.hold([])
    traps.advance(1.0)
    assert tuple(traps.position[1]) == RIGHT


def test_a_trap_on_its_time_samples_sets_out_from_where_they_have_it():
    track = Track(times=np.array([0.0, 10.0]), values=np.array([NONE, away(NONE, 10.0)]))
    traps = commands(position=track)
    now = np.array([LEFT, RIGHT, away(NONE, 3.0)])
    traps.note(now)
    traps.move({2: away(NONE, 3.0, 6.0)}, gently=True)
    traps.note(now + 1.0)  # no longer asked
    traps.advance(0.1)
    assert traps.position[2] == pytest.approx(away(NONE, 3.0, 0.1 * GENTLE), abs=ROUNDING)


@pytest.mark.parametrize("positions", [{0: LEFT, 3: LEFT}, {0: LEFT, 1: (math.nan, 0.0, 0.0)}])
def test_a_bad_gentle_move_changes_nothing(positions):
    traps = commands()
    traps.move({0: away(LEFT, 4.0)}, gently=True)
    with pytest.raises(InputError, match="allowed"):
        traps.move(positions, gently=True)
    assert traps.goals == {0: away(LEFT, 4.0)}
