"""How many trials a point gets: a number, or until its interval is narrow enough, everywhere or where a contour may be.

Whether a point goes on follows from its own trials alone (in `search`, from those of its row, which one task computes),
so that results do not depend on what else is computed, where and in which order.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.axes import Dimension
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
        of: The probability that decides; empty: each of them.
    """

    half_width: float | None = None
    level: float = 0.95
    method: Method = "clopper-pearson"
    at_least: int = 64
    at_most: int = 1024
    of: str = ""

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

    def wanted(self, successes: np.ndarray, trials: np.ndarray, row: int = 1) -> np.ndarray:
        """(n) trials that points should have, no more than they have where they have enough.

        Args:
            successes: (k, n) of each probability that is looked at.
            trials: (n) done so far.
            row: Length of the last dimension, for rules that decide along it.
        """
        if self.half_width is None or not len(successes):
            return np.full(len(trials), self.at_most)
        low, high = interval(successes, trials, level=self.level, method=self.method)
        wide = np.any(0.5 * (high - low) > self.half_width, axis=0)
        # what a normal interval of the present estimate would take, drawn into the middle as a small count is uncertain
        share = (successes + 1.0) / (trials + 2.0)
        guess = np.max(share * (1.0 - share), axis=0) * (_quantile(self.level) / self.half_width) ** 2
        return self._more(wide, np.clip(guess, np.ceil(GROWTH * trials), self.at_most), trials)

    def _more(self, on: np.ndarray, to: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """(n) trials: up to `to` for points that go on, `at_least` for all."""
        first = np.minimum(np.maximum(to * on, self.at_least), self.at_most)
        return np.where(on | (trials < self.at_least), first, trials).astype(int)

    def check(self, probabilities: Sequence[str]) -> None:
        """Refuse probabilities that this rule cannot decide by.

        Raises:
            InputError: `of` is none of them.
        """
        if self.of and self.of not in probabilities:
            known = ", ".join(probabilities) or "of which it has none"
            raise InputError(f"of is {self.of!r}; allowed: a probability of the study, {known}")

    def looks_at(self, name: str) -> bool:
        """Whether that probability decides."""
        return not self.of or name == self.of

    def arranged(self, dimensions: tuple[Dimension, ...]) -> tuple[Dimension, ...]:
        """The dimensions of a study in the order that this rule needs."""
        return dimensions

    def decided_together(self, shape: tuple[int, ...]) -> int:
        """How many neighbouring points this rule decides together: they stand in one block."""
        return 1

    def streams(self, points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """(n) int64: points of one number share the random numbers of their trials."""
        return points.astype(np.int64)

    def range_of(self, shape: tuple[int, ...]) -> tuple[int, int]:
        """Least and largest number of trials of a study of that shape."""
        points = int(np.prod(shape, dtype=np.int64))
        return (self.at_most if self.half_width is None else self.at_least) * points, self.at_most * points

    def said(self) -> dict[str, Any]:
        """What the store says of it."""
        return {"rule": type(self).__name__.lower()} | dataclasses.asdict(self)


@dataclass(frozen=True, kw_only=True)
class Contour(Stop):
    """Trials where a contour may be: a point goes on while its interval holds a level and is wider than wanted.

    Attributes:
        levels: Probabilities.
    """

    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.levels or not all(isinstance(p, int | float) and 0.0 < p < 1.0 for p in self.levels):
            raise InputError(f"contour is {self.levels}; allowed: one or more probabilities above 0 and below 1")

    def check(self, probabilities: Sequence[str]) -> None:
        """As any rule; a contour needs a probability.

        Raises:
            InputError: There is none.
        """
        super().check(probabilities)
        if not probabilities:
            raise InputError("contour needs a probability; allowed: trapped, lost, delivered, … among the observables")

    def wanted(self, successes: np.ndarray, trials: np.ndarray, row: int = 1) -> np.ndarray:
        """(n) trials that points should have; see `Stop.wanted`."""
        low, high = interval(successes, trials, level=self.level, method=self.method)
        holds = np.any([(low <= p) & (p <= high) for p in self.levels], axis=0)
        on = np.any(holds & (0.5 * (high - low) > (self.half_width or 0.0)), axis=0) & (trials < self.at_most)
        return self._more(on, np.ceil(GROWTH * trials), trials)


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


def contour(
    *levels: float,
    half_width: float = 0.02,
    level: float = 0.95,
    method: Method = "sequence",
    at_least: int = 64,
    at_most: int = 16_384,
    of: str = "",
) -> Contour:
    """Trials where the contours P = `levels` may be, until intervals there reach `half_width` to either side.

    A point that is surely above or below stops at once. It is looked at until then, so the interval is a confidence
    sequence: those of Clopper and Pearson would miss more often than they say.
    """
    return Contour(
        levels=levels, half_width=half_width, level=level, method=method, at_least=at_least, at_most=at_most, of=of
    )


def _quantile(level: float) -> float:
    from scipy.special import ndtri

    return float(ndtri(0.5 + 0.5 * level)) if level < 1.0 else math.inf
