"""How many trials a point gets: a number, or until its interval is narrow enough.

Whether a point goes on follows from its own trials alone, so that results do not depend on what else is computed, where
and in which order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.intervals import METHODS, Method, check_level, interval

GROWTH = 1.5
"""A point that goes on gets at least half as many trials again."""


@dataclass(frozen=True, kw_only=True)
class Stop:
    """When a point has enough trials.

    Attributes:
        half_width: Of the interval of every probability; None: all points get `at_most`.
        level: Of the interval.
        method: How it is computed, a name of `METHODS`.
        at_least, at_most: Trials of a point.
    """

    half_width: float | None = None
    level: float = 0.95
    method: Method = "clopper-pearson"
    at_least: int = 64
    at_most: int = 1024

    def __post_init__(self) -> None:
        check_level(self.level)
        if self.method not in METHODS:
            raise InputError(f"method is {self.method!r}; allowed: {', '.join(METHODS)}")
        if self.half_width is not None and not 0.0 < self.half_width < 0.5:
            raise InputError(f"half width is {self.half_width!r}; allowed: above 0 and below 0.5")
        for name in ("at_least", "at_most"):
            number = getattr(self, name)
            if not isinstance(number, int) or isinstance(number, bool) or number < 1:
                raise InputError(
                    f"{name.replace('_', ' ')} is {number!r}; allowed: a whole number of trials, 1 or more"
                )
        if self.at_least > self.at_most:
            raise InputError(f"at least {self.at_least} trials and at most {self.at_most}; allowed: no more at least")

    def wanted(self, successes: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """(n) trials that points should have, no more than they have where they have enough.

        Args:
            successes: (k, n) of each probability.
            trials: (n) done so far.
        """
        if self.half_width is None or not len(successes):
            return np.full(len(trials), self.at_most)
        low, high = interval(successes, trials, level=self.level, method=self.method)
        wide = np.any(0.5 * (high - low) > self.half_width, axis=0)
        # what a normal interval of the present estimate would take, drawn into the middle as a small count is uncertain
        share = (successes + 1.0) / (trials + 2.0)
        guess = np.max(share * (1.0 - share), axis=0) * (_quantile(self.level) / self.half_width) ** 2
        more = np.clip(guess, np.ceil(GROWTH * trials), self.at_most)
        first = np.maximum(more * wide, self.at_least)
        return np.where(wide | (trials < self.at_least), np.minimum(first, self.at_most), trials).astype(int)


def half_width(
    width: float,
    *,
    level: float = 0.95,
    method: Method = "clopper-pearson",
    at_least: int = 64,
    at_most: int = 16_384,
) -> Stop:
    """Trials until the interval of every probability reaches `width` to either side, half its length."""
    return Stop(half_width=width, level=level, method=method, at_least=at_least, at_most=at_most)


def trials(count: int, *, level: float = 0.95) -> Stop:
    """The same number of trials everywhere; `level` is that of the intervals."""
    return Stop(level=level, at_least=1, at_most=count)


def stop_of(given: Mapping[str, Any]) -> Stop:
    """A rule as a study file writes it: `trials`, or `half_width` and what goes with it.

    Raises:
        InputError: Anything else.
    """
    allowed = {"trials", "half_width", "level", "method", "at_least", "at_most"}
    rest = set(given) - allowed
    if rest or ("trials" in given) == ("half_width" in given):
        raise InputError(f"stop has {', '.join(sorted(given)) or 'nothing'}; allowed: trials or half_width, and level, "
                         "method, at_least, at_most")  # fmt: skip
    how = {key: value for key, value in given.items() if key not in ("trials", "half_width")}
    try:
        if "trials" in given:
            return trials(given["trials"], **how)
        return half_width(given["half_width"], **how)
    except TypeError:
        raise InputError(f"stop is {dict(given)}; allowed: numbers, and beside trials a level alone") from None


def _quantile(level: float) -> float:
    from scipy.special import ndtri

    return float(ndtri(0.5 + 0.5 * level)) if level < 1.0 else math.inf
