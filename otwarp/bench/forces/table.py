"""The table of `otwarp bench forces`, as text in cells: for the terminal and for documentation."""

from __future__ import annotations

from otwarp.bench.forces.result import ForcesBench, Row
from otwarp.bench.report import NOTHING, Table

HEAD = (
    "force model",
    "10⁶ bead-steps/s",
    "ns per bead-step",
    "of harmonic",
    "rms error, region",
    "largest, region",
    "rms error, trapped bead",
    "table [kB]",
    "build [s]",
)


def table(bench: ForcesBench, title: str) -> Table:
    """A row for every force model, and below how they were measured."""
    return Table(title=title, head=HEAD, rows=[_cells(row) for row in bench.rows], note=caption(bench))


def _cells(row: Row) -> tuple[str, ...]:
    e = row.errors
    return (
        row.label,
        row.rate.times(1e-6).text(".4g"),
        f"{row.cost.median:.4g}",
        row.ratio.text(),
        *(f"{v:.1e}" if e else NOTHING for v in ((e.rms, e.largest, e.thermal_rms) if e else (0.0, 0.0, 0.0))),
        f"{1e-3 * row.table_bytes:.4g}" if row.table_bytes else NOTHING,
        f"{row.build_seconds:.2g}" if row.build_seconds is not None else NOTHING,
    )


def caption(bench: ForcesBench) -> str:
    """What was measured and how, in sentences."""
    clock = "processor time of one thread" if bench.kind == "cpu" else "wall time"
    across, along = 1e3 * bench.spread[0], 1e3 * bench.spread[2]
    return (
        f"{bench.worlds} beads, {bench.bead()}, one trap each, Brownian noise, time step "
        f"{1e6 * bench.time_step:.4g} µs in all rows; {clock}, median (lower – upper quartile) of {bench.rounds} "
        f"repeats taken in turns with the harmonic trap. Errors are |F − F_exact| over the peak force, "
        f"{bench.peak:.4g} pN: at {bench.probes[0]} random points within {bench.region:.3g} µm of the equilibrium (the "
        f"region, up to the nearest way out), and at {bench.probes[1]} points where a trapped bead is found (standard "
        f"deviations {across:.3g} nm across and {along:.3g} nm along the beam). A build time is missing where the "
        f"table was in the cache."
    )
