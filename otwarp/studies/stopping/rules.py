"""How many trials a point gets: a number, until its interval is narrow enough, or as many as a budget has for it.

Whether a point goes on follows from its own trials alone (in `search`, from those of its row, which one task computes;
with a budget, from those of all points after each round), so that results do not depend on where and in which order
they are computed.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.axes import Dimension
from otwarp.studies.stopping.intervals import METHODS, Method, check_level, interval

GROWTH = 1.5
"""A point that goes on without a guess of what that takes gets half as many trials again."""

LEAST_MORE, MOST_MORE = 1.25, 4.0
"""How many times its trials a point gets at least and at most that goes on until its interval is narrow: what a small
count says of how many that takes is uncertain, and nine in ten points of a map need few."""


@dataclass(frozen=True, kw_only=True)
class Stop:
    """When a point has enough trials.

    Attributes:
        half_width: Of the interval of every probability; None: all points get `at_most`.
        level: Of the interval.
        method: How it is computed, a name of `methods`.
        at_least, at_most: Trials of a point.
        of: The probability that decides; empty: each of them.
        budget: Trials of all points together, spent where they are wanted most; None: each point has its own.
        methods: Names of the methods that this kind of rule may decide by.

    Raises:
        InputError: One of them out of range, or more trials at least than at most.
    """

    half_width: float | None = None
    level: float = 0.95
    method: str = "clopper-pearson"
    at_least: int = 64
    at_most: int = 1024
    of: str = ""
    budget: int | None = None
    methods: ClassVar[tuple[str, ...]] = METHODS

    def __post_init__(self) -> None:
        check_level(self.level)
        if self.method not in self.methods:
            raise InputError(f"method is {self.method!r}; allowed: {', '.join(self.methods)}")
        width = self.half_width
        if width is not None and not (isinstance(width, int | float | np.floating) and 0.0 < width < 0.5):
            raise InputError(f"half width is {self.half_width!r}; allowed: above 0 and below 0.5")
        for name in ("at_least", "at_most", *(() if self.budget is None else ("budget",))):
            number = getattr(self, name)
            if not isinstance(number, int) or isinstance(number, bool) or number < 1:
                raise InputError(
                    f"{name.replace('_', ' ')} is {number!r}; allowed: a whole number of trials, 1 or more"
                )
        if self.at_least > self.at_most:
            raise InputError(f"at least {self.at_least} trials and at most {self.at_most}; allowed: no more at least")

    def interval(self, successes: np.ndarray, trials: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k, n) ends of the intervals by which this rule decides.

        Args:
            successes: (k, n) of each probability that is looked at.
            trials: (n) done so far.
        """
        return interval(successes, trials, level=self.level, method=self.method)

    @property
    def hardest(self) -> tuple[float, ...]:
        """Probabilities whose intervals take most trials, of those that are to be narrow."""
        return (0.5,)

    def reached(self) -> float | None:
        """Half-width that intervals come to with `at_most` trials where that is more than wanted; else None."""
        if self.half_width is None:
            return None
        low, high = self.interval(np.rint(np.array(self.hardest) * self.at_most)[None], np.array(self.at_most))
        widest = 0.5 * float(np.max(high - low))
        return widest if widest > self.half_width else None

    def wanted(self, successes: np.ndarray, trials: np.ndarray, row: int = 1) -> np.ndarray:
        """(n) trials that points should have, no more than they have where they have enough.

        Args:
            successes: (k, n) of each probability that is looked at.
            trials: (n) done so far.
            row: Length of the last dimension, for rules that decide along it.
        """
        if self.half_width is None or not len(successes):
            return np.full(len(trials), self.at_most)
        low, high = self.interval(successes, trials)
        wide = np.any(0.5 * (high - low) > self.half_width, axis=0)
        # what a normal interval of the present estimate would take, drawn into the middle as a small count is
        # uncertain; exact intervals are wider by about half a trial to either side
        share = (successes + 1.0) / (trials + 2.0)
        guess = np.max(share * (1.0 - share), axis=0) * (_quantile(self.level) / self.half_width) ** 2
        guess = np.ceil(guess + 1.0 / self.half_width)
        return self.going_on(wide, np.clip(guess, np.ceil(LEAST_MORE * trials), MOST_MORE * trials), trials)

    def going_on(self, on: np.ndarray, to: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """(n) trials that points should have: at least `at_least`, and no more than `at_most`.

        Args:
            on: (n) whether a point goes on.
            to: (n) trials of those that do.
            trials: (n) done so far.
        """
        first = np.minimum(np.maximum(to * on, self.at_least), self.at_most)
        return np.where(on | (trials < self.at_least), first, trials).astype(int)

    def shares(self, successes: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """(n) trials that points of a study should have after another round of spending its budget.

        The first round gives each point its least number. Each of the others looks for the width that all wider
        intervals would come to if the rest of the budget were spent on them, as widths fall with the root of the
        number; their points get what that takes, but not more than half as many again at once, for who is wide is
        known better after every round.

        Args:
            successes: (k, n) of each probability that is looked at.
            trials: (n) done so far, 0 or all of the last round's.
        """
        assert self.budget is not None
        if not np.any(trials):
            return np.full(len(trials), self.at_least)
        wide = self.width(*self.interval(successes, trials))
        on = np.flatnonzero((wide > (self.half_width or 0.0)) & (trials < self.at_most))
        on = on[np.argsort(-wide[on], kind="stable")]
        left = self.budget - int(trials.sum())

        def needed(width: float) -> np.ndarray:
            """More trials for intervals of that half-width."""
            return np.clip(trials[on] * ((wide[on] / width) ** 2 - 1.0), 0.0, self.at_most - trials[on])

        low, high = self.half_width or 1e-6, 0.5
        for _ in range(50):
            middle = math.sqrt(low * high)
            low, high = (low, middle) if needed(middle).sum() <= left else (middle, high)
        more = np.minimum(np.ceil(needed(high)), np.ceil((GROWTH - 1.0) * trials[on])).astype(int)
        if not np.any(more):  # nobody is wider by a trial
            more = np.minimum(1, self.at_most - trials[on])
        out = trials.copy()
        out[on] += np.clip(left - (np.cumsum(more) - more), 0, more)
        return out

    def width(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """(n) half-widths that a budget is to make smaller: of the widest of (k, n) intervals `low` … `high`."""
        return np.max(0.5 * (high - low), axis=0)

    def check(self, probabilities: Sequence[str], points: int) -> None:
        """Refuse probabilities that this rule cannot decide by, and a budget that does not go round.

        Args:
            probabilities: Names of those that the study asks for.
            points: Number of its points.

        Raises:
            InputError: `of` is none of them, or the budget is too small.
        """
        if self.budget is not None and not probabilities:
            raise InputError("budget needs a probability; allowed: trapped, lost, delivered, … among the observables")
        if self.budget is not None and self.budget < points * self.at_least:
            raise InputError(f"budget is {self.budget} trials; allowed: {points * self.at_least} or more, "
                             f"{self.at_least} (at_least) for each of {points} points")  # fmt: skip
        if self.of and self.of not in probabilities:
            known = ", ".join(probabilities) or "of which it has none"
            raise InputError(f"of is {self.of!r}; allowed: a probability of the study, {known}")

    def looks_at(self, name: str) -> bool:
        """Whether the probability of that `name` decides."""
        return not self.of or name == self.of

    def arranged(self, dimensions: tuple[Dimension, ...]) -> tuple[Dimension, ...]:
        """The dimensions of a study in the order that this rule needs."""
        return dimensions

    def decided_together(self, shape: tuple[int, ...]) -> int:
        """How many neighbouring points of a study of a `shape` this rule decides together: they stand in one block."""
        return 1

    def streams(self, points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """(n) int64 for points of a study of a `shape`: those of one number share random numbers of their trials."""
        return points.astype(np.int64)

    def range_of(self, shape: tuple[int, ...]) -> tuple[int, int]:
        """Least and largest number of trials of a study of that shape."""
        points = int(np.prod(shape, dtype=np.int64))
        least, most = (self.at_most if self.half_width is None else self.at_least) * points, self.at_most * points
        return (least, most) if self.budget is None else (min(least, self.budget), min(most, self.budget))

    def said(self) -> dict[str, Any]:
        """What the store says of it."""
        said = {"rule": type(self).__name__.lower()} | dataclasses.asdict(self)
        return said if self.budget is not None else {name: v for name, v in said.items() if name != "budget"}


def half_width(
    width: float,
    *,
    level: float = 0.95,
    method: Method = "clopper-pearson",
    at_least: int = 64,
    at_most: int = 16_384,
    of: str = "",
    budget: int | None = None,
) -> Stop:
    """Trials until the interval of every probability reaches `width` to either side, half its length.

    Args:
        width: Half the length of an interval that is narrow enough, above 0 and below 0.5.
        level: Of the intervals, such as 0.95.
        method: How they are computed, a name of `otwarp.studies.stopping.intervals.METHODS`.
        at_least, at_most: Trials of a point.
        of: Name of the probability that decides; empty: each of them.
        budget: Trials of all points together, those with the widest intervals first; None: each point has its own.

    Raises:
        InputError: One of them out of range.
    """
    how = {"level": level, "method": method, "at_least": at_least, "at_most": at_most, "of": of, "budget": budget}
    return Stop(half_width=width, **how)  # type: ignore[arg-type]


def budget(
    count: int,
    *,
    level: float = 0.95,
    method: Method = "clopper-pearson",
    at_least: int = 64,
    at_most: int = 16_384,
    of: str = "",
) -> Stop:
    """So many trials of all points together, spent where intervals are widest; no point gets more than `at_most`.

    Args:
        count: Trials of all points together.
        level: Of the intervals, such as 0.95.
        method: How they are computed, a name of `otwarp.studies.stopping.intervals.METHODS`.
        at_least, at_most: Trials of a point.
        of: Name of the probability that decides; empty: each of them.

    Raises:
        InputError: One of them out of range.
    """
    return Stop(level=level, method=method, at_least=at_least, at_most=at_most, of=of, budget=count)


def trials(count: int, *, level: float = 0.95) -> Stop:
    """The same number of trials everywhere.

    Args:
        count: Trials of every point.
        level: Of the intervals, such as 0.95.

    Raises:
        InputError: One of them out of range.
    """
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise InputError(f"trials is {count!r}; allowed: a whole number of trials, 1 or more")
    return Stop(level=level, at_least=1, at_most=count)


def _quantile(level: float) -> float:
    from scipy.special import ndtri

    return float(ndtri(0.5 + 0.5 * level)) if level < 1.0 else math.inf
