"""Speed beside other programs: the section of `otwarp bench speed` for docs/benchmarks/speed.md."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.report import Section, Table, command, options, save_json
from otwarp.bench.machine import Machine
from otwarp.bench.speed.measure import SECONDS, bench_speed
from otwarp.bench.speed.table import HEAD, caption, table_rows
from otwarp.device import pick_device


def measure(
    device: str = "cpu", *, cases: Sequence[str] = (), rounds: int = 7, seconds: float = SECONDS, scale: float = 1.0
) -> Section:
    """All cases, or those named; see `bench_speed`."""
    place = pick_device(device)
    machine = Machine.look(place)
    found = bench_speed(cases=cases, device=device, rounds=rounds, seconds=seconds, scale=scale)
    table = Table(title="Speed, beside other programs", head=HEAD, rows=table_rows(found), note=caption(found))
    return Section(name="speed", kind=found.kind, machine=machine, tables=[table], data=found.json())


def main() -> None:
    """Command line."""
    parser = options("Speed beside other programs.", rounds=7)
    parser.add_argument("--case", nargs="+", default=(), help="cases to measure")
    arguments = parser.parse_args()
    section = measure(arguments.device, cases=arguments.case, rounds=arguments.rounds)
    print(section.markdown())
    if arguments.json:
        save_json(arguments.json, [section])


if __name__ == "__main__":
    command(main)
