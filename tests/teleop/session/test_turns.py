"""Turns of the live loop begin with images, within limits; all on one virtual clock."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import pytest

from otwarp.teleop.operators.servo import LinkedClock
from otwarp.teleop.perception import PerceptionNow
from tests.teleop.session.stage import RATE, Stage


class Announced:
    """A perception that sees nothing, and is told of images at given times.

    Args:
        clock: Of the session; every turn takes `work` of it [s].
        interval: Between images [s].
    """

    blind: ClassVar[dict[int, str]] = {}
    warnings = ()

    def __init__(self, clock: LinkedClock, interval: float, work: float):
        self._clock, self._interval, self._work = clock, interval, work
        self._next, self.turns, self.ages = interval, [], []

    def start(self) -> None: ...
    def restart(self) -> None: ...
    def close(self) -> None: ...
    def published(self) -> None: ...

    def now(self) -> PerceptionNow:
        return PerceptionNow(camera="announced", ended="", rate=1.0 / self._interval, bodies=())

    def update(self, sim, now, position, power) -> None:
        self.turns.append(now)
        if self._next <= now:
            passed = math.floor((now - self._next) / self._interval + 1e-9)
            self.ages.append(now - self._next - passed * self._interval)
            self._next += (passed + 1) * self._interval
        self._clock.sleep_until(now + self._work)

    def await_news(self, until: float) -> bool:
        if self._next > until:
            return False
        self._clock.sleep_until(max(self._next, self._clock.now()))
        return True


@pytest.mark.parametrize(
    ("interval", "work", "rate", "turns", "age"),
    [
        (0.01, 0.004, RATE, 100.0, 0.0),  # each image has a turn of its own
        (0.01, 0.009, RATE, 100.0, 0.0),  # as long as a turn takes no longer
        (0.01, 0.012, RATE, 1 / 0.012, 0.01),  # then turns go on without a pause
        (0.002, 0.004, RATE, RATE, 0.002),  # images do not hurry the loop
        (0.05, 0.004, RATE, RATE, 0.5 / RATE),  # nor does it wait for one that is far away
        (0.03, 0.004, 60.0, 60.0, 1.0 / 60.0),  # nor for longer than forces bear
    ],
)
def test_a_turn_begins_with_an_image(interval, work, rate, turns, age):
    clock = LinkedClock()
    seen = Announced(clock, interval, work)
    hand = "virtual:line,from=0/0/0,to=0/0/0,mass=0"
    Stage(clock=clock, options={"perception": seen, "rate": rate}, right=hand).loop.run(2.0)
    gaps = np.diff(seen.turns)
    assert len(seen.turns) / 2.0 == pytest.approx(turns, rel=0.03)
    assert gaps.min() > 1.0 / rate - 1e-9
    assert gaps.max() < max(1.5 / rate, work + 1e-3) + 1e-3
    assert np.mean(seen.ages) <= age + 1e-6
