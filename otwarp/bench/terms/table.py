"""The tables of `otwarp bench terms`."""

from __future__ import annotations

from typing import Any

from otwarp.bench.report import Table
from otwarp.bench.terms.measure import TermsBench


def tables(bench: TermsBench) -> list[Table]:
    """Cost of each term, of several together, of the readout, and a bead beside NumPy."""
    clock = "wall time on the GPU, CPU time for NumPy" if bench.kind == "cuda" else "CPU time"
    return [
        _cost_table(bench.terms, bench.bodies),
        _sum_table(bench.together),
        _readout_table(bench.readout),
        _peer_table(bench.numpy, clock),
    ]


def _cost_table(found: dict[str, dict[str, Any]], bodies: int) -> Table:
    rows = []
    for term, f in found.items():
        before, after = f["drivers"]
        rows.append(
            (
                term,
                f"{f['off'].median:.3g}",
                f"{f['on'].median:.3g}",
                f["cost"].text("+.3g"),
                before if before == after else f"{before} → {after}",
                f"{f['bytes_per_world'][1] - f['bytes_per_world'][0]:+d}",
            )
        )
    return Table(
        title=f"Cost of each term [ns per body-step], {bodies} bodies, one thread",
        head=("term", "without", "with", "cost", "driver", "memory [B/world]"),
        rows=rows,
    )


def _sum_table(sums: dict[str, dict[str, Any]]) -> Table:
    rows = [
        (
            label,
            f["step"].text(".3g"),
            f["cost"].text("+.3g") if f["sum_of_parts"] is not None else "",
            f"{f['sum_of_parts']:+.3g}" if f["sum_of_parts"] is not None else "",
            str(f["bytes_per_world"]),
        )
        for label, f in sums.items()
    ]
    return Table(
        title="Together [ns per body-step]",
        head=("scene", "step", "over the bare bead", "sum of the costs alone", "memory [B/world]"),
        rows=rows,
    )


def _readout_table(found: dict[str, dict[str, Any]]) -> Table:
    labels = {"harmonic": "bead in a harmonic trap", "robot, traps": "robot of 5 spheres in 3 piecewise traps"}
    return Table(
        title="Trap readout, each time it is asked for [ns per body]",
        head=("scene", "traps", "cost"),
        rows=[(labels[name], str(f["traps"]), f["cost"].text(".3g")) for name, f in found.items()],
    )


def _peer_table(peer: dict[str, Any], clock: str) -> Table:
    variance = peer["variance"]
    return Table(
        title=f"{peer['beads']} Brownian beads in harmonic traps [million particle-steps per second of {clock}]",
        head=("code", "rate", "variance [k_B T/k]"),
        rows=[
            ("otwarp", peer["otwarp"].times(1e-6).text(), f"{variance['otwarp']:.3f}"),
            ("NumPy loop, float32", peer["numpy"].times(1e-6).text(), f"{variance['numpy']:.3f}"),
            ("ratio, pair by pair; scheme's own variance", peer["ratio"].text(), f"{variance['theory']:.3f}"),
        ],
    )
