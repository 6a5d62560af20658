"""The table of `otwarp bench speed`, as text in cells: for the terminal and for documentation."""

from __future__ import annotations

from otwarp.bench.report import NOTHING, Table
from otwarp.bench.speed.result import SpeedBench, SpeedRow

HEAD = ("workload", "count", "rate", "unit", "of the case's first", "goal", "variance")


def table(bench: SpeedBench, title: str) -> Table:
    """A row for every workload, peers after an arrow, and below how they were measured."""
    return Table(title=title, head=HEAD, rows=[_cells(row) for row in bench.rows], note=caption(bench))


def _cells(row: SpeedRow) -> tuple[str, ...]:
    label = f"→ {row.label}" if row.peer else row.label
    if row.rate is None:
        return (label, NOTHING, f"skipped: {row.skipped}", NOTHING, NOTHING, NOTHING, NOTHING)
    goal = NOTHING
    if row.goal is not None:
        goal = f"{row.goal:.2g} {'reached' if row.rate.median >= row.goal else 'missed'}"
    return (
        label,
        str(row.worlds),
        row.rate.text(".4g"),
        row.unit,
        row.ratio.text() if row.ratio else "1",
        goal,
        f"{row.check:.4f}" if row.check is not None else NOTHING,
    )


def caption(bench: SpeedBench) -> str:
    """What was measured and how, in sentences."""
    clock = "processor time of one thread, unless a row says wall time" if bench.kind == "cpu" else "wall time"
    return (
        f"{bench.hardware}; {clock}; median (lower – upper quartile) of {bench.rounds} repeats, taken in turns with "
        "the first row of the case. Arrows mark codes for that one workload. A variance is the "
        "stationary one over that of the scheme at this step; it is 1 but for chance."
    )
