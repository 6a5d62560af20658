"""How simulated time follows the wall's: whole steps, no bursts, and every second that is given up is counted."""

from __future__ import annotations

import math
from collections import deque

from otwarp.errors import InputError
from otwarp.teleop.core import PaceNow

SPEEDS = (0.01, 10.0)
"""Simulated seconds per second that a session may be asked for."""
LONGEST_DEBT = 0.05
"""Seconds by which simulated time may lag before the lag is given up: catching up more would show as a leap."""
WINDOW = 1.0
"""Seconds over which factor and load are taken."""
LEAST = 0.25
"""Part of a frame's steps that a tick takes at least, however long they take: below, its other work would be all."""


def check_speed(speed: float) -> None:
    """Refuse a speed out of range."""
    low, high = SPEEDS
    if not low <= speed <= high:
        raise InputError(f"speed is {speed!r}; allowed: {low:g} to {high:g} simulated seconds per second")


class Pace:
    """Says how many steps are due.

    Args:
        time_step: Of the simulation [s].
        rate: Frames per second that the loop aims at [1/s].
        speed: Simulated seconds per second.
        now: Time of the loop's clock [s].
        longest_tick: Work of a tick [s] above which fewer steps are taken than are due, judged by the faster of the
            last two: one that was held up says nothing of the next.

    Attributes:
        slipped: Simulated time given up [s].
        simulated: Simulated time since the start [s].
        stood: Time of the clock in which it was paused [s].
    """

    def __init__(
        self,
        time_step: float,
        *,
        rate: float,
        speed: float = 1.0,
        now: float = 0.0,
        longest_tick: float = math.inf,
    ):
        check_speed(speed)
        self._time_step, self._rate, self._speed = time_step, rate, speed
        self._longest_tick, self._affordable, self._taken = longest_tick, (math.inf, math.inf), 0
        self._last, self._debt, self._paused = now, 0.0, False
        self.slipped = self.simulated = self.stood = 0.0
        self._ticks: deque[tuple[float, float, float, float]] = deque()  # time, simulated, wanted, busy

    @property
    def speed(self) -> float:
        """Simulated seconds per second."""
        return self._speed

    @property
    def paused(self) -> bool:
        """Whether time stands still on purpose."""
        return self._paused

    def set_speed(self, speed: float) -> None:
        """Slow motion, or back.

        Raises:
            InputError: Out of `SPEEDS`.
        """
        check_speed(speed)
        self._speed = speed

    def pause(self, on: bool, now: float) -> None:
        """Stand still, or go on from here."""
        if self._paused:
            self.stood += max(now - self._last, 0.0)
        self._paused, self._last, self._debt = on, now, 0.0

    def restart(self, now: float) -> None:
        """Begin to count at `now`; what passed since the last tick is no debt."""
        self._last, self._debt = now, 0.0

    def due(self, now: float) -> int:
        """Steps to take now."""
        elapsed = max(now - self._last, 0.0)
        # a tick that paused or reset began before it did
        self._last = max(self._last, now)
        self._taken = 0
        if self._paused:
            self.stood += elapsed
            return 0
        wanted = elapsed * self._speed
        self._debt += wanted
        longest = max(LONGEST_DEBT * self._speed, self._time_step)
        if self._debt > longest:
            self.slipped += self._debt - longest
            self._debt = longest
        least = max(1.0, LEAST * self._speed / (self._rate * self._time_step))
        steps = self._taken = int(min(self._debt / self._time_step, max(*self._affordable, least)))
        self._debt -= steps * self._time_step
        self.simulated += steps * self._time_step
        self._note(now, steps * self._time_step, wanted)
        return steps

    def worked(self, seconds: float) -> None:
        """How long the tick's work took [s]."""
        if self._taken and seconds > 0.0:
            self._affordable = self._affordable[1], self._taken * self._longest_tick / seconds
        if self._ticks:
            time, simulated, wanted, busy = self._ticks[-1]
            self._ticks[-1] = (time, simulated, wanted, busy + seconds)

    def _note(self, now: float, simulated: float, wanted: float) -> None:
        self._ticks.append((now, simulated, wanted, 0.0))
        while self._ticks[0][0] < now - WINDOW:
            self._ticks.popleft()

    def report(self) -> PaceNow:
        """What the last second was like."""
        simulated, wanted, busy = (sum(column) for column in list(zip(*self._ticks, strict=True))[1:] or ((), (), ()))
        factor = self._speed * simulated / wanted if wanted > 0.0 else self._speed
        # steps are whole: a window can hold one more than its share
        factor = min(factor, self._speed) if math.isfinite(factor) else self._speed
        span = wanted / self._speed
        return PaceNow(
            speed=self._speed,
            factor=0.0 if self._paused else factor,
            slipped=self.slipped,
            paused=self._paused,
            busy=min(busy / span, 1.0) if span > 0.0 else 0.0,
            rate=self._rate,
        )
