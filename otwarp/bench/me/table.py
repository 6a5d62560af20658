"""The table of `otwarp bench me`."""

from __future__ import annotations

from otwarp.bench.me.measure import RUNS, MyBench
from otwarp.bench.report import Table


def table(bench: MyBench) -> Table:
    """A row for each scene."""
    rows = [
        (
            bill.name,
            f"{bill.bodies:,}",
            spell(bill.duration),
            spell(bill.ready),
            spell(bill.step.median),
            digits(bill.factor.median),
            spell(bill.run),
            f"{bill.worlds:,}",
            digits(bill.all_factor.median),
            spell(bill.runs),
            f"{bill.bytes_per_world / 1024:,.3g}",
        )
        for bill in bench.scenes
    ]
    head = (
        "scene", "bodies", "a run is", "ready after", "a step takes", "× real time", "a run takes",
        "worlds at once", "× real time, all worlds", f"{RUNS:,} runs take", "KiB a world",
    )  # fmt: skip
    whose = "wall time" if bench.kind == "cuda" else "processor time of one core; worlds are shared out to all cores"
    note = f"{whose}. ready after: model, and kernels where they were not in the cache yet; recording comes on top"
    return Table(
        title=f"What scenes cost on {bench.hardware}" + (", one core" if bench.kind == "cpu" else ""),
        head=head,
        rows=rows,
        note=note,
    )


UNITS = (("d", 86400.0), ("h", 3600.0), ("min", 60.0), ("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9))


def spell(seconds: float) -> str:
    """A time as people say it, two digits or whole numbers: `45 µs`, `1.3 s`, `12 h`."""
    unit, length = next(((u, s) for u, s in UNITS if seconds >= (2.0 if s > 1.0 else 1.0) * s), UNITS[-1])
    count = seconds / length
    return f"{count:.2g} {unit}" if count < 9.95 else f"{count:,.0f} {unit}"


def digits(value: float) -> str:
    """Three digits, without powers of ten: `25,500`."""
    return f"{float(f'{value:.3g}'):,.10g}"
