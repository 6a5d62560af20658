"""Estimates with their intervals, labelled."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from otwarp.analysis.tracks import xarray
from otwarp.errors import InputError

Row = Mapping[str, tuple[float, float, float]]
"""Quantity → value, lower and upper end."""

UNITS = {
    "stiffness": ("pN/um", "trap stiffness"),
    "drag": ("pN s/um", "drag coefficient"),
    "corner_frequency": ("Hz", "stiffness over 2π drag"),
    "diffusion": ("um2/s", "diffusion coefficient"),
    "noise": ("um", "standard deviation of the detector's noise"),
    "sensitivity": ("um", "length that one unit of the signal stands for"),
}
"""Quantity → its unit and long name."""


def check_level(level: float) -> float:
    """Refuse a level that is none; the two-sided quantile of the normal distribution otherwise.

    Raises:
        InputError: One line.
    """
    from scipy.special import ndtri

    if not 0.0 < level < 1.0:
        raise InputError(f"level is {level!r}; allowed: above 0 and below 1")
    return float(ndtri(0.5 + 0.5 * level))


def check_temperature(temperature: float) -> None:
    """Refuse a temperature that is none.

    Raises:
        InputError: One line.
    """
    if not 0.0 < temperature < np.inf:
        raise InputError(f"temperature is {temperature!r}; allowed: above 0, in K")


def estimates(rows: Sequence[Row], axes: Sequence[str], *, level: float, method: str, notes: Sequence[str] = ()) -> Any:
    """A Dataset of quantities by axis, each with its ends `_low` and `_high`.

    Args:
        rows: Per axis, quantity → value, lower and upper end.
        axes: Their names.
        level: Of the intervals.
        method: What made them.
        notes: Why some are NaN.
    """
    out = xarray().Dataset(coords={"axis": list(axes)})
    for name in rows[0]:
        units, said = UNITS[name]
        table = np.array([row[name] for row in rows], dtype=float)
        attrs = {"units": units, "long_name": said, "level": level}
        for column, suffix in enumerate(("", "_low", "_high")):
            out[name + suffix] = ("axis", table[:, column], attrs)
    out.attrs = {"method": method, "level": level, "notes": "; ".join(notes)}
    return out


class NotTrapped(InputError):
    """A track on which the bead relaxed so seldom that a free one could have made it."""


def each_axis(axes: Sequence[str], row_of: Callable[[int], Row]) -> tuple[list[Row], list[str]]:
    """A row for each axis, NaN where the bead is not trapped along it, and what there is to say about that.

    Args:
        axes: Their names.
        row_of: Makes the row of an axis.

    Raises:
        NotTrapped: It is not trapped along any.
    """
    rows: dict[int, Row] = {}
    errors = []
    for n in range(len(axes)):
        try:
            rows[n] = row_of(n)
        except NotTrapped as error:
            errors.append(error)
    if not rows:
        raise errors[0]
    known = next(iter(rows.values()))
    nothing: Row = dict.fromkeys(known, (np.nan, np.nan, np.nan))
    return [rows.get(n, nothing) for n in range(len(axes))], [str(error) for error in errors]


def factor(value: float, error: float, quantile: float) -> tuple[float, float, float]:
    """A positive value with the interval of a normal error of its logarithm, 0 to inf where nothing is known."""
    with np.errstate(over="ignore"):
        return value, value * np.exp(-quantile * error), value * np.exp(quantile * error)
