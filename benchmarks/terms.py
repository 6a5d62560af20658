"""What each term of the step costs: the section of `otwarp bench terms` for docs/benchmarks/terms.md."""

from __future__ import annotations

from typing import Any

from benchmarks.report import Section, command, positive
from otwarp.bench.machine import Machine
from otwarp.bench.terms.measure import bench_terms
from otwarp.bench.terms.table import tables


def measure(device: str = "cpu", **how: Any) -> Section:
    """All terms, or the `comparisons` given; see `bench_terms`."""
    found = bench_terms(device, **how)
    return Section(
        name="terms", kind=found.kind, machine=Machine(**found.machine), tables=tables(found), data=found.data()
    )


if __name__ == "__main__":
    command(
        measure,
        "Cost of each term of the step.",
        rounds=9,
        bodies={"type": positive, "help": "bodies in all worlds together (default: 4096, CUDA 262144)"},
    )
