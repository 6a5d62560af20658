"""The map of a study: what was found at its points, as a grid of which each cell can be clicked on."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.studies import table
from otwarp.studies.store import Store
from otwarp.studies.study import Study

FIELD = "Point"
"""Label of the field into which a click puts the number of its point."""
RAMP = ((68, 1, 84), (33, 145, 140), (253, 231, 37))
"""Colours of the smallest value, the middle and the largest."""
EMPTY = (120, 126, 134)
"""Of a point without trials."""
BESIDE = ("_low", "_high", "_error", "_deviation", "_count", "_events", "_exposure")
"""Endings of what stands beside a result."""
MOST_TICKS = 8
"""Values beside the rows; of more rows each second has one, or fewer."""
HEIGHT, LEAST = 150, (8, 20)
"""Of a grid, if its cells then have a height between these [pixels]."""
MOST_CELLS = 4096
"""Cells of a grid; more are not clicked on."""


class StudyMap:
    """Results of a study over its points.

    Args:
        store: Its folder.
        study: As it was asked.

    Raises:
        InputError: Nothing of it is computed yet, or a slice of it has too many points.
    """

    def __init__(self, store: Store, study: Study):
        found = table(store)
        self._trials = np.asarray(found["trials"].values)
        if not self._trials.any():
            raise InputError(f"{store.folder}: no block is done yet; allowed: a study of which some is")
        self.dims: tuple[str, ...] = tuple(str(d) for d in found["trials"].dims)
        self.shape = study.design.shape
        if math.prod(self.shape[-2:]) > MOST_CELLS:
            raise InputError(
                f"{store.folder}: {math.prod(self.shape[-2:])} points in a slice; allowed: up to {MOST_CELLS}"
            )
        self._values = {
            str(name): np.asarray(v.values, dtype=float)
            for name, v in found.data_vars.items()
            if v.dims == found["trials"].dims
            and v.dtype.kind == "f"
            and not str(name).endswith(BESIDE)
            and str(name) != "time_step"
        }
        self.observables = tuple(self._values)
        rows = self.shape[-2] if len(self.shape) > 1 else 1
        self._high = min(max(HEIGHT // rows, LEAST[0]), LEAST[1])
        self.axes = {dim: _ticks(found, dim, n) for dim, n in zip(self.dims, self.shape, strict=True)}
        self.units = {dim: str(found[dim].attrs.get("units", "")) if dim in found.coords else "" for dim in self.dims}

    def trials(self, point: int) -> int:
        """How many trials a point has."""
        return int(self._trials.reshape(-1)[point])

    def first(self) -> int:
        """A point with trials: of those with the middle value, the first."""
        values = self._values[self.observables[0]].reshape(-1) if self.observables else np.zeros(self._trials.size)
        good = np.flatnonzero((self._trials.reshape(-1) > 0) & np.isfinite(values))
        if not len(good):
            return int(np.argmax(self._trials.reshape(-1) > 0))
        middle = 0.5 * (values[good].min() + values[good].max())
        return int(good[np.argmin(np.abs(values[good] - middle))])

    def said(self, point: int) -> tuple[tuple[str, str], ...]:
        """Where a point is: names of axes and values."""
        place = np.unravel_index(point, self.shape) if self.shape else ()
        return tuple(
            (dim, f"{self.axes[dim][int(i)]} {self.units[dim]}".strip())
            for dim, i in zip(self.dims, place, strict=True)
        )

    def grid(self, observable: str, fixed: Mapping[str, int], chosen: int) -> str:
        """The map as HTML: rows along the last dimension but one, upwards, columns along the last.

        Args:
            observable: Which result, one of `observables`.
            fixed: Index along each of the other dimensions.
            chosen: Point that is marked.
        """
        values = self._values[observable]
        good = values[np.isfinite(values)]
        low, high = (float(good.min()), float(good.max())) if good.size else (0.0, 1.0)
        if low >= 0.0 and high <= 1.0:
            low, high = 0.0, 1.0
        index = tuple(fixed.get(dim, 0) for dim in self.dims[:-2])
        numbers = np.arange(self._trials.size).reshape(self.shape)[index] if self.shape else np.zeros((1, 1), dtype=int)
        numbers = np.atleast_2d(numbers)
        rows = [self._row(row, values.reshape(-1), (low, high), chosen) for row in numbers[::-1]]
        x = self._named(self.dims[-1]) if self.dims else ""
        y = self._named(self.dims[-2]) if len(self.dims) > 1 else ""
        ticks = self.axes[self.dims[-1]] if self.dims else ("", "")
        first, last = html.escape(ticks[0]), html.escape(ticks[-1])
        return (
            f'<div style="padding:4px 12px;font-size:12.5px"><div>↑ {y}</div>{"".join(rows)}'
            f'<div style="display:flex;justify-content:space-between"><span>{first}</span><span>→ {x}</span>'
            f"<span>{last}</span></div>{_scale(low, high)}</div>"
        )

    def _named(self, dim: str) -> str:
        return html.escape(f"{dim} [{self.units[dim]}]" if self.units[dim] else dim)

    def _row(self, points: np.ndarray, values: np.ndarray, ends: tuple[float, float], chosen: int) -> str:
        cells = "".join(self._cell(int(p), float(values[p]), ends, chosen) for p in points)
        label = ""
        if len(self.dims) > 1:
            place = np.unravel_index(int(points[0]), self.shape)
            tick = self.axes[self.dims[-2]][int(place[-2])]
            number = int(place[-2])
            if number % -(-self.shape[-2] // MOST_TICKS):
                tick = ""
            label = f'<span style="width:42px;text-align:right;padding-right:5px">{html.escape(tick)}</span>'
        return f'<div style="display:flex;align-items:center;height:{self._high + 1}px;gap:1px">{label}{cells}</div>'

    def _cell(self, point: int, value: float, ends: tuple[float, float], chosen: int) -> str:
        count = self.trials(point)
        colour = ramp((value - ends[0]) / max(ends[1] - ends[0], 1e-300)) if count and math.isfinite(value) else EMPTY
        where = ", ".join(f"{name} {text}" for name, text in self.said(point))
        title = html.escape(f"{where}: {value:.3g}, {count} trials" if count else f"{where}: no trials")
        mark = "outline:2px solid #ff405c;outline-offset:-2px;" if point == chosen else ""
        return (
            f'<button type="button" data-otwarp-set="{point}" data-otwarp-field="{FIELD}" title="{title}" '
            f'aria-label="{title}" aria-pressed="{str(point == chosen).lower()}" {"" if count else "disabled"} '
            f'style="flex:1;min-width:0;height:{self._high}px;border:0;padding:0;cursor:pointer;{mark}'
            f'background:rgb{colour}"></button>'
        )


def ramp(share: float) -> tuple[int, int, int]:
    """Colour of a value by where it is between the smallest (0) and the largest (1)."""
    at = 2.0 * min(max(share, 0.0), 1.0)
    a, b = (RAMP[0], RAMP[1]) if at <= 1.0 else (RAMP[1], RAMP[2])
    t = at if at <= 1.0 else at - 1.0
    r, g, b_ = (round(x + (y - x) * t) for x, y in zip(a, b, strict=True))
    return r, g, b_


def _scale(low: float, high: float) -> str:
    colours = ",".join(f"rgb{c}" for c in RAMP)
    return (
        f'<div style="display:flex;align-items:center;gap:6px;margin-top:6px"><span>{low:.3g}</span>'
        f'<span style="flex:1;height:9px;background:linear-gradient(to right,{colours})"></span>'
        f"<span>{high:.3g}</span></div>"
    )


def _ticks(found: Any, dim: str, count: int) -> tuple[str, ...]:
    """Values along a dimension, for people."""
    if dim not in found.coords or found[dim].dims != (dim,):
        return tuple(str(n) for n in range(count))
    return tuple(f"{v:.3g}" if isinstance(v, float) else str(v) for v in found[dim].values.tolist())
