"""Tables of `otwarp bench stability` as text: one letter per cell, and what the letters stand for."""

from __future__ import annotations

import math

from otwarp.bench.report import NOTHING
from otwarp.bench.stability.measure import GridResult, StabilityBench
from otwarp.bench.stability.verdict import LEGEND, Cell, CellVerdict


def letters(grid: GridResult) -> list[tuple[str, ...]]:
    """Rows of a grid: head, then one letter per cell."""
    out = []
    for row in grid.rows:
        cells = [grid.cell(row, column) for column in grid.columns]
        out.append((row, *(c.verdict.value if c else NOTHING for c in cells)))
    return out


def head(grid: GridResult) -> tuple[str, ...]:
    """Heads of the columns; the first says what the axes are."""
    return (f"{grid.axes[0]} ╲ {grid.axes[1]}", *grid.columns)


def stated(grid: GridResult) -> str:
    """The largest errors of the accurate and of the stable cells, and the wrong cells, in one paragraph."""
    parts = []
    for verdict, words in ((CellVerdict.ACCURATE, "accurate"), (CellVerdict.STABLE, "stable")):
        worst = grid.largest(verdict)
        if worst is not None:
            parts.append(f"largest error of the {words} cells {_error(worst)} ({worst.row}; {worst.column})")
    refusals = [c for c in grid.cells if c.verdict in (CellVerdict.REFUSED, CellVerdict.STOPPED)]
    if refusals:
        parts.append(f"first refusal: {refusals[0].message}")
    wrong = [c for c in grid.cells if c.verdict is CellVerdict.WRONG]
    if wrong:
        # a defect without a number, such as one that is not finite, comes first
        worst = max(wrong, key=lambda c: math.inf if c.error is None else abs(c.error))
        parts.append(f"SILENTLY WRONG, {len(wrong)} cells, worst at {worst.row}; {worst.column}: {worst.message}")
    return ". ".join(parts) + "." if parts else ""


def _error(cell: Cell) -> str:
    assert cell.error is not None
    chance = f" ± {100.0 * cell.standard_error:.2g}" if cell.standard_error else ""
    predicted = f", predicted {100.0 * cell.predicted:.2g}" if cell.predicted else ""
    return f"{100.0 * cell.error:.2g}{chance} %{predicted}"


def legend(bench: StabilityBench) -> list[str]:
    """One line per letter, with how many cells have it."""
    return [f"{v.value}  {n:4d}  {LEGEND[v]}" for v, n in bench.counts.items()]


def plain(bench: StabilityBench) -> str:
    """All grids as text for a terminal, a letter for each cell, and the legend."""
    lines: list[str] = []
    for grid in bench.grids:
        rows = [head(grid), *letters(grid)]
        wide = [max(len(r[i]) for r in rows) for i in range(len(rows[0]))]
        # the head of the first column is long: give it its own line
        wide[0] = max(len(r[0]) for r in rows[1:])
        lines += [grid.title, f"  {rows[0][0]}"]
        for cells in (("", *rows[0][1:]), *rows[1:]):
            padded = [cells[0].ljust(wide[0]), *(c.rjust(w) for c, w in zip(cells[1:], wide[1:], strict=True))]
            lines.append("  " + "  ".join(padded))
        lines += [f"  {stated(grid)}", ""]
    return "\n".join([*lines, *legend(bench)])
