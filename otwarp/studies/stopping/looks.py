"""Intervals of points that are looked at a few times, at numbers of trials that are fixed beforehand.

Each look may miss with a part of 1 − level in proportion to the trials since the look before, which makes 1 − level in
all, whenever and why ever a point stops at one of them (a union bound; error that is spent in proportion to what is
known: Lan and DeMets 1983, doi:10.1093/biomet/70.3.659, Kim and DeMets 1987, doi:10.1093/biomet/74.1.149). As numbers
double, half of it is left for the last look, whose interval is 1.14 times as wide as that of Clopper and Pearson at one
look; a confidence sequence, which holds at every look there may be, is 1.7 to 2 times as wide.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np

from otwarp.studies.stopping.intervals import interval


def doubling(first: int, last: int) -> tuple[int, ...]:
    """Numbers of trials from `first` to `last`, each about twice the one before; the last alone if it is close."""
    steps = round(math.log2(last / first))
    ratio = (last / first) ** (1.0 / max(steps, 1))
    return (*(round(first * ratio**n) for n in range(steps)), last)


def level_at(looks: Sequence[int], level: float, trials: np.ndarray) -> np.ndarray:
    """(n) levels of the intervals of points that had `trials`, each the number of a look, or none."""
    miss = (1.0 - level) * np.diff(looks, prepend=0) / looks[-1]
    at = np.minimum(np.searchsorted(looks, trials), len(looks) - 1)
    return 1.0 - miss[at]


@functools.lru_cache(maxsize=64)
def looks_for(levels: tuple[float, ...], half_width: float, level: float, first: int, most: int) -> tuple[int, ...]:
    """Looks of which the last is the first number of trials at which no interval that holds a level is wider.

    Args:
        levels: Probabilities, above 0 and below 1.
        half_width: Half the length of an interval that is narrow enough.
        level: With which a point's interval holds its probability, wherever it stops.
        first, most: Trials at the first look, and at the last one at most.

    Returns:
        Numbers of trials in order; the last is `most` where that is too few.
    """
    low, high = first, most
    while low < high:  # widths fall with the number, but for steps of a trial
        middle = (low + high) // 2
        low, high = (low, middle) if _narrow(levels, half_width, level, doubling(first, middle)) else (middle + 1, high)
    return doubling(first, low)


def _narrow(levels: tuple[float, ...], half_width: float, level: float, looks: tuple[int, ...]) -> bool:
    """Whether all intervals of the last look that hold one of the levels are as narrow as wanted."""
    n = looks[-1]
    # the estimate lies within its interval: one farther from a level than this holds it by being too wide
    reach = math.ceil(2.0 * half_width * n) + 1
    for p in levels:
        k = np.arange(max(0, math.floor(p * n) - reach), min(n, math.ceil(p * n) + reach) + 1)
        low, high = interval(k, n, level=level_at(looks, level, np.array(n)))
        if np.any((low <= p) & (p <= high) & (0.5 * (high - low) > half_width)):
            return False
    return True
