"""Clocks and statistics that hold on a noisy machine: interleaved pairs, medians and quartiles."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import warp as wp

LONGEST_CALL = 1 << 22
"""Steps in one measured call at most, so that calibration ends on a device whose launch cost hides the work."""


@dataclass(frozen=True)
class Quartiles:
    """Median and quartiles of repeated measurements.

    Attributes:
        median: Middle value.
        low, high: Lower and upper quartile.
    """

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, samples: list[float]) -> Quartiles:
        """Median and quartiles of at least one sample, linear between the samples."""
        low, median, high = np.percentile(samples, [25.0, 50.0, 75.0])
        return cls(float(median), float(low), float(high))

    def times(self, factor: float) -> Quartiles:
        """The same in another unit; `factor` is positive."""
        return Quartiles(factor * self.median, factor * self.low, factor * self.high)

    def check(self) -> None:
        """Raise `ValueError` unless all of it is positive, as costs are."""
        if not all(0.0 < value < math.inf for value in (self.median, self.low, self.high)):
            raise ValueError("a cost that is not positive")

    def text(self, pattern: str = ".3g") -> str:
        """`median (low – high)`."""
        return f"{self.median:{pattern}} ({self.low:{pattern}} – {self.high:{pattern}})"


class Pairs(NamedTuple):
    """Samples of two measurements taken in turns, equally many."""

    first: list[float]
    second: list[float]

    def difference(self) -> Quartiles:
        """Second minus first, pair by pair."""
        return Quartiles.of([b - a for a, b in zip(self.first, self.second, strict=True)])

    def ratio(self) -> Quartiles:
        """First over second, pair by pair."""
        return Quartiles.of([a / b for a, b in zip(self.first, self.second, strict=True)])


@dataclass(frozen=True)
class Elapsed:
    """Time one call took: by the wall and by this process's processors, all threads together [s]."""

    wall: float
    cpu: float

    def on(self, device: wp.Device) -> float:
        """What the call cost the device: processor time on the CPU, where neighbours steal wall time; else wall."""
        return self.cpu if device.is_cpu else self.wall


def elapsed(work: Callable[[], object], device: wp.Device) -> Elapsed:
    """Time one call, from an idle device until the device is idle again."""
    wp.synchronize_device(device)
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    wp.synchronize_device(device)
    return Elapsed(time.perf_counter() - wall, time.process_time() - cpu)


def calls_for(work: Callable[[int], object], device: wp.Device, seconds: float) -> int:
    """Steps n for which `work(n)` takes about `seconds`; warms caches up on the way."""
    steps = 1
    work(steps)
    while True:
        taken = elapsed(partial(work, steps), device).on(device)
        if taken >= 0.5 * seconds or steps >= LONGEST_CALL:
            return max(1, min(LONGEST_CALL, round(steps * seconds / max(taken, 1e-9))))
        steps *= 2 if taken < 0.1 * seconds else max(2, int(seconds / taken))


Measurement = Callable[[], float]

Note = Callable[[str], None]
"""Called with what is being done, often enough to stop there."""


def interleaved(
    pairs: Mapping[str, tuple[Measurement, Measurement]],
    rounds: int,
    *,
    note: Note = lambda name: None,
) -> dict[str, Pairs]:
    """Measure every pair once per round, the order within a pair swapped from round to round.

    The samples of a pair are spread over the whole benchmark and its halves taken one right after the other, so
    neither a slow second nor a slow drift of the machine decides a figure. `note` hears which pair is next.
    """
    out = {name: Pairs([], []) for name in pairs}
    for i in range(rounds):
        for name, (first, second) in pairs.items():
            note(name)
            found = out[name]
            for kept, measurement in ((found.first, first), (found.second, second))[:: 1 if i % 2 == 0 else -1]:
                kept.append(measurement())
    return out
