"""Which moment of a recording is shown: a clock that can be stopped, sped up, stepped and put anywhere."""

from __future__ import annotations

import numpy as np

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 50.0)
"""Simulated seconds per second that a user may choose."""


def index_at(times: np.ndarray, time: float) -> int:
    """Number of the latest moment that is not after a time [s]; the first one before all."""
    # a time that was asked for may miss a moment by a rounding error, and would show the one before
    return max(int(np.searchsorted(times, time + 1e-9, side="right")) - 1, 0)


class Playback:
    """A clock over the times of a recording.

    Args:
        time: (n,) times of its moments, rising [s].
    """

    def __init__(self, time: np.ndarray):
        self._times = np.asarray(time, dtype=float)
        self.time = float(self._times[0])
        """Shown at present [s]."""
        self.speed = 1.0
        self.playing, self.loop = False, False
        self._last: float | None = None

    @property
    def first(self) -> float:
        """Time of the first moment [s]."""
        return float(self._times[0])

    @property
    def last(self) -> float:
        """Time of the last moment [s]."""
        return float(self._times[-1])

    @property
    def index(self) -> int:
        """Number of the latest moment that is not after the time shown."""
        return self.at(self.time)

    def at(self, time: float) -> int:
        """Number of the latest moment that is not after a time [s]."""
        return index_at(self._times, time)

    def toggle(self) -> None:
        """Play, or stand still; from the end on it begins anew."""
        if not self.playing and self.time >= self.last:
            self.time = self.first
        self.playing, self._last = not self.playing, None

    def seek(self, time: float) -> None:
        """Go to a time [s]; beyond the ends, to them."""
        self.time = min(max(float(time), self.first), self.last)

    def step(self, moments: int) -> None:
        """Go on by so many moments, or back, and stand still."""
        self.playing = False
        index = min(max(self.index + moments, 0), len(self._times) - 1)
        self.time = float(self._times[index])

    def faster(self, steps: int) -> None:
        """Choose the next of `SPEEDS`, or the one before."""
        nearest = int(np.argmin(np.abs(np.log(np.array(SPEEDS) / self.speed))))
        self.speed = SPEEDS[min(max(nearest + steps, 0), len(SPEEDS) - 1)]

    def tick(self, now: float) -> bool:
        """The clock of the wall shows `now` [s]; whether the time shown has changed."""
        before, last = self.time, self._last
        self._last = now
        if not self.playing or last is None:
            return False
        self.time += (now - last) * self.speed
        if self.time >= self.last:
            if self.loop and self.last > self.first:
                self.time = self.first + (self.time - self.last) % (self.last - self.first)
            else:
                self.time, self.playing = self.last, False
        return self.time != before
