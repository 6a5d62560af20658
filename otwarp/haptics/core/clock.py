"""What time it is for a servo, and how it waits: the machine's clock, or a virtual one for tests."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol


class Clock(Protocol):
    """A monotonic clock [s]."""

    def now(self) -> float:
        """Time [s]."""
        ...

    def sleep_until(self, deadline: float) -> None:
        """Return at `deadline` [s] or as soon as possible after it."""
        ...


def next_deadline(deadline: float, period: float, now: float) -> tuple[float, int]:
    """The next deadline after one [s], and how many had passed already: those are dropped, never caught up."""
    deadline += period
    if now < deadline:
        return deadline, 0
    missed = int((now - deadline) / period) + 1
    return deadline + missed * period, missed


class RealClock:
    """`time.perf_counter`, which all processes of a machine share; deadlines are absolute, so errors do not add up.

    Args:
        spin: Last part of a wait that is spent looking at the clock instead of sleeping [s]. Where measured, 100 µs of
            it took 12 µs off the median lateness under SCHED_FIFO, at a tenth of a core; without SCHED_FIFO the
            scheduler punished it with pauses of milliseconds. So it is off unless asked for.
    """

    def __init__(self, spin: float = 0.0):
        self.spin = spin
        self.now: Callable[[], float] = time.perf_counter

    def sleep_until(self, deadline: float) -> None:
        """See `Clock`."""
        rest = deadline - self.spin - time.perf_counter()
        if rest > 0.0:
            time.sleep(rest)
        if self.spin:
            while time.perf_counter() < deadline:
                pass


class VirtualClock:
    """Time that passes only by waiting, for tests that must give the same result on any machine.

    Args:
        start: First time [s].
        late: How late the k-th wait returns [s], k = 0, 1, …; never, by default.
    """

    def __init__(self, start: float = 0.0, late: Callable[[int], float] | None = None):
        self._now = start
        self._late = late
        self._waits = 0

    def now(self) -> float:
        """See `Clock`."""
        return self._now

    def sleep_until(self, deadline: float) -> None:
        """See `Clock`."""
        late = self._late(self._waits) if self._late else 0.0
        self._waits += 1
        self._now = max(self._now, deadline) + late

    def advance(self, seconds: float) -> None:
        """Let time pass, as work does [s]."""
        self._now += seconds
