"""Stress tests of numerical stability: every cell of every grid is accurate, stable with stated error or reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from otwarp.bench.findings import Findings
from otwarp.bench.machine import Machine
from otwarp.bench.stability.grids import GRIDS, StressGrid
from otwarp.bench.stability.thermal import Effort
from otwarp.bench.stability.verdict import Cell, CellVerdict, judge
from otwarp.bench.timing import Note
from otwarp.bench.typed import check_names
from otwarp.device import pick_device
from otwarp.errors import InputError

QUICK, FULL, LONG = (
    {"worlds": 4096, "random_scenes": 12, "steps": 100_000},
    {"worlds": 16384, "random_scenes": 96, "steps": 1_000_000},
    {"worlds": 16384, "random_scenes": 96, "steps": 100_000_000},
)
"""Efforts of `--quick`, of neither option, and of `--long`."""


@dataclass(frozen=True, kw_only=True)
class GridResult:
    """The cells of one grid; `name`, `title` and `axes` as `StressGrid`."""

    name: str
    title: str
    axes: tuple[str, str]
    cells: tuple[Cell, ...]

    @property
    def rows(self) -> tuple[str, ...]:
        """Heads of the rows."""
        return tuple(dict.fromkeys(c.row for c in self.cells))

    @property
    def columns(self) -> tuple[str, ...]:
        """Heads of the columns."""
        return tuple(dict.fromkeys(c.column for c in self.cells))

    def cell(self, row: str, column: str) -> Cell | None:
        """The cell at a place, if there is one."""
        return next((c for c in self.cells if (c.row, c.column) == (row, column)), None)

    def largest(self, verdict: CellVerdict) -> Cell | None:
        """The cell of that verdict with the largest error."""
        found = [c for c in self.cells if c.verdict is verdict and c.error is not None]
        return max(found, key=lambda c: abs(c.error or 0.0), default=None)


@dataclass(frozen=True, kw_only=True)
class StabilityBench(Findings):
    """What `bench_stability` found.

    Attributes:
        effort: Worlds, random scenes and steps of the longest run.
        grids: In the order of `GRIDS`.
    """

    effort: Effort
    grids: tuple[GridResult, ...]

    FORMAT = "otwarp bench stability"

    @property
    def counts(self) -> dict[CellVerdict, int]:
        """Cells of every verdict."""
        found = Counter(c.verdict for g in self.grids for c in g.cells)
        return {v: found[v] for v in CellVerdict}

    @property
    def wrong(self) -> tuple[tuple[str, Cell], ...]:
        """StressGrid name and cell of everything silently wrong."""
        return tuple((g.name, c) for g in self.grids for c in g.cells if c.verdict is CellVerdict.WRONG)

    def json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "format": self.FORMAT,
            "version": self.VERSION,
            "kind": self.kind,
            "machine": self.machine,
            "effort": {name: value for name, value in vars(self.effort).items() if name != "device"},
            "counts": {v.name.lower(): n for v, n in self.counts.items()},
            "grids": [
                {"name": g.name, "title": g.title, "axes": list(g.axes), "cells": [c.json() for c in g.cells]}
                for g in self.grids
            ],
        }


def chosen_grids(names: Sequence[str], *, quick: bool) -> tuple[StressGrid, ...]:
    """The grids of these names, or for no names those that the effort asks for.

    Raises:
        InputError: A name that is not in `GRIDS`.
    """
    check_names("--grid", names, [grid.name for grid in GRIDS])
    return tuple(g for g in GRIDS if g.name in names or (not names and not (quick and g.full_only)))


def bench_stability(
    *,
    grids: Sequence[str] = (),
    device: str | None = None,
    quick: bool = False,
    long: bool = False,
    effort: Effort | None = None,
    note: Note = lambda text: None,
) -> StabilityBench:
    """Run the stress tests.

    Args:
        grids: Names of `GRIDS`, none for all.
        device: `cpu`, `cuda:0`, … or None for the best available.
        quick: Fewer worlds and scenes, and without the grids that take long to compile.
        long: Runs of 10⁸ steps.
        effort: Instead of those of `quick` and `long`; its device does not count.
        note: Hears what is being done.

    Raises:
        InputError: An unknown grid or device, or both `quick` and `long`.
    """
    if quick and long:
        raise InputError("--quick comes with --long; allowed: one of the two")
    wanted = chosen_grids(grids, quick=quick)
    place = pick_device(device)
    usual = QUICK if quick else LONG if long else FULL
    numbers = usual if effort is None else {n: v for n, v in vars(effort).items() if n != "device"}
    how = Effort(device=place.alias, **numbers)
    results = []
    for grid in wanted:
        cells = []
        for row, column, measure in grid.cells(how):
            note(f"{grid.name}: {row}, {column}")
            cells.append(judge(row, column, measure))
        results.append(GridResult(name=grid.name, title=grid.title, axes=grid.axes, cells=tuple(cells)))
    return StabilityBench(
        **Machine.look(place).about(),
        effort=how,
        grids=tuple(results),
    )
