"""What traps are told in the course of time: positions and powers, between samples in a straight line."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np

from otwarp.errors import InputError
from otwarp.scene import Scene

MOST_PASSED = 60
"""Samples that a straight line of commands stands for, at most."""


class Commands:
    """Positions [µm] and powers [mW] of T traps as one vector (4 T) of time: all x, y, z, then all powers.

    Args:
        times: (n) samples, increasing; two at one time are a jump [s].
        values: (n, 4 T) at these; before the first and after the last they stay.
    """

    def __init__(self, times: np.ndarray, values: np.ndarray):
        self.times: list[float] = [float(t) for t in times]
        self.values: list[np.ndarray] = [np.asarray(v, dtype=float) for v in values]
        self._passed: list[tuple[float, np.ndarray]] = []  # samples since the last but one, which its line goes by
        if any(b < a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise InputError("times of commands go backwards; allowed: samples in their order")

    @classmethod
    def of_scene(cls, scene: Scene) -> Commands:
        """The time samples of a scene's traps."""
        tracks = [t.position for t in scene.traps] + [t.power for t in scene.traps]
        times = np.unique(np.concatenate([np.zeros(1), *[track.times for track in tracks]]))
        rows = [track.at_times(times) for track in tracks]
        return cls(times, np.concatenate(rows, axis=1) if rows else np.zeros((len(times), 0)))

    @classmethod
    def of_samples(cls, times: np.ndarray, position: np.ndarray, power: np.ndarray) -> Commands:
        """From recorded positions (n, T, 3) [µm] and powers (n, T) [mW]."""
        return cls(times, np.concatenate([np.reshape(position, (len(times), -1)), power], axis=1))

    @property
    def traps(self) -> int:
        """Number of traps T."""
        return len(self.values[0]) // 4

    def at(self, time: float) -> np.ndarray:
        """(4 T) at a time; at a jump, after it."""
        k = bisect_right(self.times, time)
        if k == 0:
            return self.values[0]
        if k == len(self.times):
            return self.values[-1]
        return self._between(k, time)

    def before(self, time: float) -> np.ndarray:
        """(4 T) at a time; at a jump, before it."""
        k = bisect_left(self.times, time)
        if k == 0:
            return self.values[0]
        if k == len(self.times):
            return self.values[-1]
        return self._between(k, time)

    def _between(self, k: int, time: float) -> np.ndarray:
        first, last = self.times[k - 1], self.times[k]
        share = (time - first) / (last - first)
        return (1.0 - share) * self.values[k - 1] + share * self.values[k]

    def corners(self, start: float, end: float) -> list[float]:
        """Times of samples between two times, in their order, each once."""
        first, last = bisect_right(self.times, start), bisect_left(self.times, end)
        return sorted(set(self.times[first:last]))

    def set(self, time: float, *, position: np.ndarray | None = None, power: np.ndarray | None = None) -> None:
        """A command that holds from a time on; samples after it are forgotten.

        Args:
            time: [s].
            position: (T, 3) [µm]; None: as they are then.
            power: (T) [mW], likewise.

        Raises:
            InputError: Another shape, or a number that is not finite.
        """
        new = self._told(self.at(time), position, power)
        before = self.before(time)
        keep = bisect_left(self.times, time)
        self._passed.clear()
        self.times = [*self.times[:keep], time, time]
        self.values = [*self.values[:keep], before, new]

    def reach(
        self,
        time: float,
        *,
        position: np.ndarray | None = None,
        power: np.ndarray | None = None,
        tolerance: float = 0.0,
    ) -> None:
        """Traps get there at a time, in a straight line from the sample before; later samples are forgotten.

        Samples on a straight line are kept as its ends: every one that is kept costs whoever leads a body along.

        Args:
            time: After the first sample [s].
            position: (T, 3) [µm]; None: as in the sample before.
            power: (T) [mW], likewise.
            tolerance: By how much samples that are left out may be off the line [µm, mW].

        Raises:
            InputError: Another shape, or a number that is not finite.
        """
        keep = bisect_left(self.times, time)
        new = self._told(self.values[max(keep - 1, 0)], position, power)
        if keep < len(self.times):
            del self.times[keep:], self.values[keep:]
            self._passed.clear()
        if self._passed and len(self._passed) < MOST_PASSED and len(self.times) > 1:
            start, span = self.times[-2], time - self.times[-2]
            share = (np.array([t for t, _ in self._passed]) - start)[:, None] / span
            line = self.values[-2] + share * (new - self.values[-2])
            if np.all(np.abs(line - np.array([v for _, v in self._passed])) <= tolerance):
                self._passed.append((time, new))
                self.times[-1], self.values[-1] = time, new
                return
        self._passed = [(time, new)]
        self.times.append(time)
        self.values.append(new)

    def forget(self, before: float) -> None:
        """Drop samples that say nothing of a time [s] and later ones."""
        first = bisect_right(self.times, before) - 1
        if first > 0:
            del self.times[:first], self.values[:first]

    def _told(self, old: np.ndarray, position: np.ndarray | None, power: np.ndarray | None) -> np.ndarray:
        """(4 T) values with what is given of them."""
        t, new = self.traps, old.copy()
        for name, given, part, shape in (
            ("position", position, slice(0, 3 * t), (t, 3)),
            ("power", power, slice(3 * t, 4 * t), (t,)),
        ):
            if given is None:
                continue
            value = np.asarray(given, dtype=float)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise InputError(f"{name} of the traps has shape {value.shape}; allowed: {shape}, finite numbers")
            new[part] = value.ravel()
        return new
