"""How simulated time follows the wall's: whole steps, no bursts, and every second that is given up is counted.

`Pace` says how many steps are due. With a budget, `BudgetWatch` says at what speed to go on: the load of a machine
changes, and what was measured before the session is not kept for ever. A speed can change at once; bodies that froze or
left, and an accuracy that was lowered, come back with a new session alone, and where they would fit, that is said.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from otwarp.errors import InputError
from otwarp.teleop import BEHIND, PaceNow
from otwarp.teleop.budget import round_down
from otwarp.teleop.budget.report import BudgetReport

SPEEDS = (0.01, 10.0)
"""Simulated seconds per second that a session may be asked for."""
LONGEST_DEBT = 0.05
"""Seconds by which simulated time may lag before the lag is given up: catching up more would show as a leap."""
WINDOW = 1.0
"""Seconds over which factor and load are taken."""
LEAST = 0.25
"""Part of a frame's steps that a tick takes at least, however long they take: below, its other work would be all."""

HOLD = 5.0
"""Seconds for which the machine must carry another speed before that one is taken."""
WORTH = 1.1
"""Speed over the present one from which on it is worth a change."""


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
        """How many steps are due at `now` [s] of the clock."""
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


class BudgetWatch:
    """Says at what speed a session is to go on, by what its loop takes.

    A simulated second costs busy/factor seconds of a core, so the budget carries share·factor/busy. More is taken up to
    the speed that was wanted; less, when the session slips, so that simulated time does not. A speed that somebody sets
    in the session is wanted from then on.

    Args:
        report: Of the search before the session.
        say: Takes lines for the user.
    """

    def __init__(self, report: BudgetReport, say: Callable[[str], None]):
        self._report, self._say = report, say
        self._wanted, self._set = report.speed_asked, report.speed
        self._since: float | None = None
        self._direction = 0
        self._told = False

    def __call__(self, now: float, pace: PaceNow) -> float | None:
        """The speed to go on at, None for the present one.

        Args:
            now: On the loop's clock [s].
            pace: Of the last second.
        """
        if pace.speed != self._set:
            self._wanted = self._set = pace.speed
            self._direction = 0
        if pace.paused or pace.factor <= 0.0 or pace.busy <= 0.0:
            self._direction = 0
            return None
        carried = round_down(self._report.share * pace.factor / pace.busy)
        slips = pace.factor < BEHIND * pace.speed
        target = max(min(carried, self._wanted), SPEEDS[0])
        rises = pace.speed < self._wanted and target >= min(WORTH * pace.speed, self._wanted)
        direction = -1 if slips and target < pace.speed else int(rises and not slips)
        if direction != self._direction or self._since is None:
            self._direction, self._since = direction, now
        if now - self._since < HOLD:
            return None
        self._since = now
        self._tell_of_the_whole(pace)
        if direction == 0:
            return None
        why = "carries more" if direction > 0 else "carries less than before the session"
        self._say(f"budget: this machine {why}: {target:g} simulated seconds per second from now on")
        self._set = target
        return target

    def _tell_of_the_whole(self, pace: PaceNow) -> None:
        """Once, when what was left out would fit: in proportion to what the reduced scene takes now."""
        report = self._report
        if self._told or not report.reduced or report.before is None or report.after is None:
            return
        expected = report.after.load(1.0, report.rate)
        ratio = pace.busy / pace.factor / expected if expected > 0.0 else math.inf
        if ratio * report.before.load(report.speed_asked, report.rate) <= report.share:
            self._told = True
            self._say("budget: this machine carries the whole scene by now; start the session anew to have it")
