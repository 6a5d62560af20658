"""Stress tests of stability: the section of `otwarp bench stability` for docs/benchmarks/stability.md."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks import headlines
from benchmarks.report import PAGES, Section, check_places, options, positive, run, save_json, write_pages
from otwarp.bench.machine import Machine
from otwarp.bench.report import Table
from otwarp.bench.stability.measure import bench_stability
from otwarp.bench.stability.table import head, legend, letters, stated
from otwarp.bench.stability.thermal import Effort
from otwarp.device import pick_device


def measure(
    device: str = "cpu",
    *,
    grids: Sequence[str] = (),
    rounds: int = 1,
    quick: bool = True,
    long: bool = False,
    processes: int = 1,
    effort: Effort | None = None,
) -> Section:
    """All grids, or those named; see `bench_stability`. Nothing is timed: `rounds` does not count."""
    place = pick_device(device)
    machine = Machine.look(place)
    found = bench_stability(
        grids=grids, device=device, quick=quick and not long, long=long, processes=processes, effort=effort
    )
    # the heads of the columns are numbers; what they are stands in the first
    tables = [Table(title=g.title, head=head(g), rows=letters(g), note=stated(g)) for g in found.grids]
    if tables:
        lines = [tuple(line.split(maxsplit=2)) for line in legend(found)]
        rows = [(letter, words, count) for letter, count, words in lines]
        tables.append(Table(title="Letters", head=("letter", "meaning", "cells"), rows=rows))
    asked = "--long" if long else "" if quick else "--full"
    return Section(name="stability", kind=found.kind, machine=machine, tables=tables, data=found.json(), asked=asked)


def main() -> None:
    """Command line."""
    parser = options("Stress tests of stability.", rounds=1)
    parser.add_argument("--grid", nargs="+", default=(), help="grids to run")
    parser.add_argument("--full", action="store_true", help="all worlds and scenes")
    parser.add_argument("--long", action="store_true", help="also runs of 10⁸ steps")
    parser.add_argument("--processes", type=positive, default=1, help="cells that run at a time")
    parser.add_argument("--write", action="store_true", help="rewrite the tables of docs/benchmarks")
    arguments = parser.parse_args()
    check_places(arguments.out, (PAGES / "stability.md", headlines.SUMMARY) if arguments.write else ())
    section = measure(
        arguments.device,
        grids=arguments.grid,
        quick=not (arguments.full or arguments.long),
        long=arguments.long,
        processes=arguments.processes,
    )
    print(section.markdown())
    if arguments.out:
        save_json(arguments.out, [section])
    if arguments.write:
        write_pages([section])
        headlines.write()


if __name__ == "__main__":
    run(main)
