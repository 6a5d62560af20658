"""What each term of the step costs: the section of `otwarp bench terms` for docs/benchmarks/terms.md."""

from __future__ import annotations

from typing import Any

from benchmarks.report import Section, command, options, positive, save_json
from otwarp.bench.machine import Machine
from otwarp.bench.terms.measure import bench_terms
from otwarp.bench.terms.table import tables


def measure(device: str = "cpu", **how: Any) -> Section:
    """All terms, or the `comparisons` given; see `bench_terms`."""
    found = bench_terms(device, **how)
    return Section(
        name="terms", kind=found.kind, machine=Machine(**found.machine), tables=tables(found), data=found.data()
    )


def main() -> None:
    """Command line."""
    parser = options("Cost of each term of the step.", rounds=9)
    parser.add_argument("--bodies", type=positive, help="bodies in all worlds together (default: 4096, CUDA 262144)")
    arguments = parser.parse_args()
    section = measure(arguments.device, rounds=arguments.rounds, bodies=arguments.bodies)
    print(section.markdown())
    if arguments.out:
        save_json(arguments.out, [section])


if __name__ == "__main__":
    command(main)
