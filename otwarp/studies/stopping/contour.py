"""Trials where the contours of a map may be: a point goes on while its interval holds a level and is wide.

Points that are surely above or below stop early, which is most of a map; a point at the level gets what its interval
takes to be narrow. It is looked at after numbers of trials that are fixed beforehand (see `looks`), so that intervals
hold as often as they say wherever a point stops. Of a budget each round takes those points first that are least sure on
which side they are: how far their interval reaches to the other side, the ambiguity of Gotovos et al. 2013 ("Active
learning for level set estimation", IJCAI), with exact intervals of each point in the place of those of a Gaussian
process, as the "straddle" of Bryan et al. 2005 (NeurIPS 18) has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from otwarp.errors import InputError
from otwarp.studies.stopping.intervals import interval
from otwarp.studies.stopping.looks import doubling, level_at, looks_for
from otwarp.studies.stopping.rules import GROWTH, Stop

LOOKS = "looks"
"""The method whose intervals hold at numbers of trials that are fixed beforehand."""


@dataclass(frozen=True, kw_only=True)
class Contour(Stop):
    """Trials where a contour may be: a point goes on while its interval holds a level and is wider than wanted.

    Attributes:
        levels: Probabilities, above 0 and below 1.
        looks: Numbers of trials after which a point is looked at, by the method `looks`; `at_least` is the first of
            them, and `at_most` the last. Empty with other methods.

    Raises:
        InputError: One of them out of range.
    """

    levels: tuple[float, ...]
    looks: tuple[int, ...] = field(init=False, default=())
    methods: ClassVar[tuple[str, ...]] = (LOOKS, "sequence")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.levels or not all(isinstance(p, int | float) and 0.0 < p < 1.0 for p in self.levels):
            raise InputError(f"contour is {self.levels}; allowed: one or more probabilities above 0 and below 1")
        if self.method == LOOKS:
            few, many = self.at_least, self.at_most
            looks = (
                doubling(few, many)
                if self.half_width is None
                else looks_for(tuple(self.levels), self.half_width, self.level, few, many)
            )
            for name, value in {"looks": looks, "at_least": looks[0], "at_most": looks[-1]}.items():
                object.__setattr__(self, name, value)  # what follows from the others

    @property
    def hardest(self) -> tuple[float, ...]:
        """The levels; see `Stop.hardest`."""
        return self.levels

    def check(self, probabilities: Sequence[str], points: int) -> None:
        """As `Stop.check`; a contour needs a probability.

        Raises:
            InputError: There is none.
        """
        super().check(probabilities, points)
        if not probabilities:
            raise InputError("contour needs a probability; allowed: trapped, lost, delivered, … among the observables")

    def interval(self, successes: np.ndarray, trials: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k, n) ends of the intervals by which this rule decides; see `Stop.interval`."""
        if not self.looks:
            return super().interval(successes, trials)
        return interval(successes, trials, level=level_at(self.looks, self.level, trials))

    def wanted(self, successes: np.ndarray, trials: np.ndarray, row: int = 1) -> np.ndarray:
        """(n) trials that points should have; see `Stop.wanted`."""
        on = self._open(*self.interval(successes, trials)) & (trials < self.at_most)
        if self.looks:
            return np.where(on, self._next(trials), trials)
        return self.going_on(on, np.ceil(GROWTH * trials), trials)

    def shares(self, successes: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """(n) trials after another round of spending a budget, as `Stop.shares`.

        Points go on to their next look, those first that are least sure on which side of a level they are; what is left
        of a budget when no look of theirs fits into it is not spent.
        """
        if not self.looks or not np.any(trials):
            return super().shares(successes, trials)
        low, high = self.interval(successes, trials)
        on = np.flatnonzero(self._open(low, high) & (trials < self.at_most))
        sides = [np.minimum(high - p, p - low) for p in self.levels]
        on = on[np.argsort(-np.max(sides, axis=(0, 1))[on], kind="stable")]
        more = self._next(trials)[on] - trials[on]
        fits = on[np.cumsum(more) <= (self.budget or 0) - int(trials.sum())]
        out = trials.copy()
        out[fits] = self._next(trials)[fits]
        return out

    def width(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """(n) as of any rule; 0 for intervals `low` … `high` that hold none of the levels."""
        holds = np.any([(low <= p) & (p <= high) for p in self.levels], axis=0)
        return np.max(np.where(holds, 0.5 * (high - low), 0.0), axis=0)

    def said(self) -> dict[str, Any]:
        """What the store says of it; its looks where it has some."""
        return {name: value for name, value in super().said().items() if name != "looks" or value}

    def _open(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """(n) whether one of the (k, n) intervals holds a level and is wider than wanted."""
        return self.width(low, high) > (self.half_width or 0.0)

    def _next(self, trials: np.ndarray) -> np.ndarray:
        """(n) trials at the next look; the last for those who had it."""
        at = np.searchsorted(self.looks, trials, side="right")
        return np.asarray(self.looks)[np.minimum(at, len(self.looks) - 1)]


def contour(
    *levels: float,
    half_width: float = 0.02,
    level: float = 0.95,
    method: Literal["looks", "sequence"] = "looks",
    at_least: int = 16,
    at_most: int = 16_384,
    of: str = "",
    budget: int | None = None,
) -> Contour:
    """Trials where the contours P = `levels` may be, until intervals there reach `half_width` to either side.

    A point that is surely above or below stops at its next look. As it is looked at until then, intervals of Clopper
    and Pearson would miss more often than they say and are refused: those of a few looks share what they may miss.

    Args:
        levels: Probabilities, above 0 and below 1.
        half_width: Half the length of an interval that is narrow enough, above 0 and below 0.5.
        level: Of the intervals, such as 0.95.
        method: How they are computed: `looks`, or `sequence`, which is valid at every number of trials and wider.
        at_least, at_most: Trials of a point.
        of: Name of the probability that decides; empty: each of them.
        budget: Trials of all points together, those first that are least sure on which side they are; None: each point
            has its own.

    Raises:
        InputError: One of them out of range.
    """
    how = {"level": level, "method": method, "at_least": at_least, "at_most": at_most, "of": of, "budget": budget}
    return Contour(levels=levels, half_width=half_width, **how)  # type: ignore[arg-type]
