"""Stress tests of numerical stability: every cell of every grid is accurate, stable with stated error or reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
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
from otwarp.processes import worker_processes

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
        """All grids and the machine as plain data, for JSON."""
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


@dataclass(frozen=True, kw_only=True)
class Task:
    """One cell to run.

    Attributes:
        effort: How hard to try.
        grid: Name of its grid.
        number: Its place among the cells of the grid, in reading order.
    """

    effort: Effort
    grid: str
    number: int

    def run(self) -> Cell:
        """The cell; the same in whatever process."""
        grid = next(g for g in GRIDS if g.name == self.grid)
        row, column, measure = list(grid.cells(self.effort))[self.number]
        return judge(row, column, measure)


def run_tasks(tasks: Sequence[Task], processes: int) -> Iterator[tuple[Task, Cell]]:
    """Run cells, as they get done. With several processes those of all grids side by side, as each has its kernels.

    Raises:
        InputError: One of several processes was killed.
    """
    if processes == 1:
        yield from ((task, task.run()) for task in tasks)
        return
    with worker_processes(min(processes, len(tasks))) as pool:
        ordered = sorted(tasks, key=lambda task: task.number)
        for done in as_completed([pool.submit(_run, task) for task in ordered]):
            yield done.result()


def _run(task: Task) -> tuple[Task, Cell]:
    return task, task.run()


def bench_stability(
    *,
    grids: Sequence[str] = (),
    device: str | None = None,
    quick: bool = False,
    long: bool = False,
    processes: int = 1,
    effort: Effort | None = None,
    note: Note = lambda text: None,
) -> StabilityBench:
    """Run the stress tests.

    Args:
        grids: Names of `GRIDS`, none for all.
        device: `cpu`, `cuda:0`, … or None for the best available.
        quick: Fewer worlds and scenes, and without the grids that take long to compile.
        long: Runs of 10⁸ steps.
        processes: How many cells run at a time, each in a process; they find the same.
        effort: Instead of those of `quick` and `long`; its device does not count.
        note: Hears what is being done.

    Raises:
        InputError: An unknown grid or device, both `quick` and `long`, or no process.
    """
    if quick and long:
        raise InputError("--quick comes with --long; allowed: one of the two")
    if processes < 1:
        raise InputError(f"--processes is {processes}; allowed: 1 or more")
    wanted = chosen_grids(grids, quick=quick)
    place = pick_device(device)
    usual = QUICK if quick else LONG if long else FULL
    numbers = usual if effort is None else {n: v for n, v in vars(effort).items() if n != "device"}
    how = Effort(device=place.alias, **numbers)
    tasks = [Task(effort=how, grid=g.name, number=n) for g in wanted for n, _ in enumerate(g.cells(how))]
    found: dict[tuple[str, int], Cell] = {}
    for task, cell in run_tasks(tasks, processes):
        note(f"{task.grid}: {cell.row}, {cell.column}")
        found[task.grid, task.number] = cell
    results = (
        GridResult(
            name=g.name,
            title=g.title,
            axes=g.axes,
            cells=tuple(found[t.grid, t.number] for t in tasks if t.grid == g.name),
        )
        for g in wanted
    )
    return StabilityBench(
        **Machine.look(place).about(),
        effort=how,
        grids=tuple(results),
    )
