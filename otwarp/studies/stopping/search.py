"""The largest value along an axis at which a probability is still reached: bisection with common random numbers.

All points of a row along that axis share the random numbers of their trials, which makes what is found in trials nearly
monotone, and comparisons of neighbours sharp. Three boundaries are bisected at once: up to where the estimate reaches
the probability, up to where the lower end of its interval does, and up to where the upper end does. At the true limit
the interval holds the probability as often as its level says, so that the values between the last that surely reaches
it and the first that surely does not hold the limit as often (a test turned over: Casella and Berger 2002, section
9.2.1). Each of the three needs the probability not to rise along the axis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError, nearest
from otwarp.studies.axes import Dimension, spoken
from otwarp.studies.stopping.contour import contour
from otwarp.studies.stopping.rules import Stop, budget, half_width, trials


@dataclass(frozen=True, kw_only=True)
class Largest(Stop):
    """Trials where they tell the largest value along an axis at which a probability is still reached.

    Attributes:
        probability: That is to be reached.
        along: Name of the axis, whose values rise.
    """

    probability: float
    along: str

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.probability, int | float) or not 0.0 < self.probability < 1.0:
            raise InputError(f"largest is {self.probability!r}; allowed: a probability above 0 and below 1")

    def check(self, probabilities: Sequence[str], points: int) -> None:
        """As any rule; one probability decides.

        Raises:
            InputError: There is none, or it is not said which.
        """
        super().check(probabilities, points)
        if len(probabilities) != 1 and not self.of:
            raise InputError(
                f"largest needs one probability, not {', '.join(probabilities) or 'none'}; allowed: of = one of them"
            )

    def arranged(self, dimensions: tuple[Dimension, ...]) -> tuple[Dimension, ...]:
        """The same with the one that is searched last.

        Raises:
            InputError: It is none of them, or does not rise.
        """
        along = [d for d in dimensions if self.along in (d.name, *d.columns)]
        if not along:
            known = ", ".join(name for d in dimensions for name in d.columns)
            raise InputError(
                f"along is {self.along!r}; allowed: an axis of the study, {known or 'of which it has none'}"
            )
        first = next(iter(along[0].columns.values())).values
        if first.ndim != 1 or first.dtype.kind != "f" or np.any(np.diff(first) <= 0.0):
            raise InputError(f"along is {self.along}, whose values do not rise; allowed: an axis of rising numbers")
        return (*(d for d in dimensions if d is not along[0]), along[0])

    def decided_together(self, shape: tuple[int, ...]) -> int:
        """A row along the axis."""
        return shape[-1]

    def streams(self, points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """(n) int64: one number for each row."""
        return points.astype(np.int64) // shape[-1]

    def range_of(self, shape: tuple[int, ...]) -> tuple[int, int]:
        """One boundary needs a bisection; three, at most as many."""
        rows, looks = int(np.prod(shape[:-1], dtype=np.int64)), math.ceil(math.log2(shape[-1] + 1))
        return rows * looks * self.at_most, rows * min(3 * looks, shape[-1]) * self.at_most

    def wanted(self, successes: np.ndarray, trials: np.ndarray, row: int = 1) -> np.ndarray:
        """(n) trials that points should have, in rows of `row`: all of them or none; see `Stop.wanted`."""
        low, high = (end[0] for end in self.interval(successes[:1], trials))
        seen = np.where(trials > 0, successes[0] / np.maximum(trials, 1), np.nan)
        out = trials.reshape(-1, row).copy()
        known = out > 0
        for value in (seen, low, high):
            last, first = boundary(value.reshape(-1, row) >= self.probability, known)
            open_rows = np.flatnonzero(first - last > 1)
            out[open_rows, (last + first)[open_rows] // 2] = self.at_most
        return out.ravel()


def boundary(reached: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(rows) places of the first known value that is not reached, and of the last known one before it that is.

    The second is given first; −1 and the length of a row stand for none.
    """
    length = reached.shape[-1]
    places = np.arange(length)
    first = np.where(known & ~reached, places, length).min(axis=-1, initial=length)
    last = np.where(known & reached & (places < first[..., None]), places, -1).max(axis=-1, initial=-1)
    return last, first


def largest(probability: float, *, along: str, trials: int = 512, level: float = 0.95, of: str = "") -> Largest:
    """The largest value along an axis at which a probability is still reached, by bisection.

    Args:
        probability: That is to be reached.
        along: Name of an axis, as `speed:/World/Traps/trap`, whose values rise: what is found lies between two of them.
        trials: Of every point that is looked at; those of one row share their random numbers.
        level: Of the intervals.
        of: Name of the probability, where the study has several.
    """
    return Largest(probability=probability, along=along, level=level, at_least=trials, at_most=trials, of=of)


def largest_in(found: Any, name: str, probability: float, along: str) -> Any:
    """The largest value along a dimension of a table at which a probability is still reached, as an `xarray.Dataset`.

    Args:
        found: What `Study.run` or `table` gave.
        name: Of a probability in it.
        probability: That is to be reached.
        along: Name of a dimension, along which it does not rise.

    Returns:
        `largest`, between the values beside it by their probabilities, NaN where those do not enclose it; `largest_low`
        and `largest_high`, which hold it as often as intervals hold theirs: NaN and inf where the axis ends before.

    Raises:
        InputError: No such probability or dimension.
    """
    import xarray

    if name not in found or f"{name}_low" not in found:
        known = [str(v)[:-4] for v in found if str(v).endswith("_low") and "units" not in found[v].attrs]
        raise InputError(f"probability is {name!r}; allowed: {', '.join(known) or 'one of the table, which has none'}")
    if along not in found[name].dims:
        raise InputError(f"along is {along!r}; allowed: {', '.join(map(str, found[name].dims)) or 'a dimension'}")
    x = np.asarray(found[along].values, dtype=float)
    rows = [found[part].transpose(..., along) for part in (name, f"{name}_low", f"{name}_high", "trials")]
    seen, low, high, trials = (np.asarray(row.values) for row in rows)
    known = trials > 0
    last, first = boundary(seen >= probability, known)
    inside = (last >= 0) & (first < len(x))
    a, b = np.maximum(last, 0), np.minimum(first, len(x) - 1)
    p, q = (np.take_along_axis(seen, np.expand_dims(at, -1), -1)[..., 0] for at in (a, b))
    with np.errstate(invalid="ignore", divide="ignore"):
        between = x[a] + (x[b] - x[a]) * (p - probability) / (p - q)
    sure, _ = boundary(low >= probability, known)
    _, never = boundary(high >= probability, known)
    unit = {"units": found[along].attrs["units"]} if "units" in found[along].attrs else {}
    what = str(found[along].attrs.get("long_name", along))
    title = f"largest {spoken(what)} with P({name}) ≥ {probability:g}"
    dims = rows[0].dims[:-1]
    parts = {
        "largest": np.where(inside, between, np.nan),
        "largest_low": np.where(sure >= 0, x[np.maximum(sure, 0)], np.nan),
        "largest_high": np.where(never < len(x), x[np.minimum(never, len(x) - 1)], np.inf),
    }
    coords = {c: v for c, v in found.coords.items() if along not in v.dims}
    return xarray.Dataset({n: (dims, v, unit | {"long_name": title}) for n, v in parts.items()}, coords=coords)


SAID = {
    "trials": trials,
    "half_width": half_width,
    "contour": lambda levels, **how: contour(*(levels if isinstance(levels, list) else [levels]), **how),
    "largest": largest,
    "budget": budget,
}
"""Rules that a study file names, and what makes them."""


def stop_of(given: Mapping[str, Any]) -> Stop:
    """A rule as a study file writes it: one of `SAID`, and what goes with it.

    Raises:
        InputError: Anything else.
    """
    named = next((kind for kind in ("largest", "contour", "half_width", "trials", "budget") if kind in given), None)
    how = ("level", "method", "at_least", "at_most", "of")
    if named is None:
        strange = next((key for key in given if key not in (*how, "along")), None)
        if strange is not None:
            raise InputError(f"stop has {strange}{nearest(strange, list(SAID))}")
        raise InputError(f"stop has no rule; allowed: one of {', '.join(SAID)}")
    rest = {key: value for key, value in given.items() if key != named}
    allowed = {
        "trials": ("level",),
        "half_width": (*how, "budget"),
        "contour": ("half_width", *how, "budget"),
        "largest": ("along", "trials", "level", "of"),
        "budget": how,
    }[named]
    wrong = next((key for key in rest if key not in allowed), None)
    if wrong is not None and (near := nearest(wrong, allowed)).startswith("; did"):
        raise InputError(f"stop with {named} has {wrong}{near}")
    if wrong is not None or (named == "largest" and "along" not in rest):
        raise InputError(f"stop with {named} has {wrong or 'no along'}; allowed beside it: {', '.join(allowed)}")
    try:
        return SAID[named](given[named], **rest)
    except TypeError:
        raise InputError(f"stop is {dict(given)}; allowed: numbers, and names as texts") from None
