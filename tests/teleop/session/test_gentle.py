"""Gentle moves in the live loop: a flick of the mouse keeps the sphere, also one made in a pause."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest

from otwarp import teleop as c
from otwarp.teleop.operators.hands import GENTLE
from tests.teleop.scenes import PLACES
from tests.teleop.session.stage import RATE, Stage, place

FLICK = (PLACES["left"][0] + 4.0, *PLACES["left"][1:])
ROUNDING = 1e-5
"""Of float32 places of size 10 [µm]."""


@pytest.fixture
def stage() -> Iterator[Stage]:
    one = Stage()
    one.loop.start()
    yield one
    one.loop.close()


def test_a_flick_of_the_mouse_keeps_its_sphere(stage):
    stage.watcher.asked = [c.MoveTraps({0: FLICK}, gently=True)]
    live = stage.run(1.0)
    places = np.array([frame.frame.trap_position[0, 0] for frame in stage.watcher.frames])
    times = [frame.frame.time for frame in stage.watcher.frames]
    for (a, t), (b, u) in itertools.pairwise(zip(places, times, strict=True)):
        assert np.linalg.norm(b - a) <= GENTLE * (u - t) + ROUNDING
    assert places[-1] == pytest.approx(FLICK, abs=ROUNDING) and place(live, 0) == pytest.approx(FLICK, abs=0.01)
    assert stage.watcher.frames[5].trap_goals == {0: FLICK} and live.trap_goals == {}
    assert not any(frame.warnings for frame in stage.watcher.frames)


def test_the_same_at_once_loses_it(stage):
    stage.watcher.asked = [c.MoveTraps({0: FLICK})]
    live = stage.run(1.0)
    assert place(live, 0)[0] < PLACES["left"][0] + 1.0  # the far tail of the trap draws it a little
    assert live.frame.trap_position[0, 0] == pytest.approx(FLICK, abs=ROUNDING)
    assert any(line.startswith("trap_left has lost its sphere") for line in live.warnings)


def test_what_is_dragged_in_a_pause_travels_when_the_session_goes_on(stage):
    stage.run(0.1)
    stage.watcher.asked = [c.Pause(True)]
    stage.run(0.1)
    for share in (0.25, 0.5, 1.0):
        stage.watcher.asked = [c.MoveTraps({0: (PLACES["left"][0] + 4.0 * share, *FLICK[1:])}, gently=True)]
        still = stage.run(0.1)
    assert still.frame.trap_position[0, 0] == pytest.approx(PLACES["left"], abs=ROUNDING)
    assert still.trap_goals == {0: FLICK}
    stage.watcher.asked = [c.Pause(False)]
    on = stage.run(6.0 / RATE)
    travelled = on.frame.trap_position[0, 0, 0] - PLACES["left"][0]
    assert travelled == pytest.approx(GENTLE * (on.frame.time - still.frame.time), abs=ROUNDING) and travelled > 0.5
    live = stage.run(0.5)
    assert place(live, 0) == pytest.approx(FLICK, abs=0.01) and not live.warnings
