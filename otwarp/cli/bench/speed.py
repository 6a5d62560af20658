"""`otwarp bench speed`: steps per second of typical scenes, beside other programs."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.bench.options import OUTPUT, Output, note, print_table
from otwarp.cli.options import device_option, with_options
from otwarp.cli.types import COUNT, POSITIVE, SECONDS


@click.command()
@click.option(
    "--case", "cases", multiple=True, metavar="NAME", help="Measure this case; may be repeated. Default: all."
)
@click.option("--rounds", type=COUNT, default=7, show_default=True, help="Repeats of each figure.")
@click.option("--seconds", type=SECONDS, default=0.2, show_default=True, help="Length of one measured call [s].")
@click.option(
    "--scale", type=POSITIVE, default=1.0, show_default=True, help="Part of the usual number of worlds and particles."
)
@device_option
@with_options(*OUTPUT[:3])
def speed(
    cases: tuple[str, ...],
    rounds: int,
    seconds: float,
    scale: float,
    device: str | None,
    out: Path | None,
    as_json: bool,
    plot: Path | None,
) -> None:
    """Steps per second of typical scenes, in turns with codes that others would write for one of them.

    Cases: bead (in a spring, beside NumPy, C and numba, as far as they are installed), table (bead in a tabulated
    trap), robot (five spheres, three tabulated traps), delivery (the shipped cell delivery), crowd (many spheres that
    touch), scaling (more and more worlds), threads (two against one). python -m benchmarks.speed, in a checkout of the
    source, sets more programs beside them.
    """
    from otwarp.bench.speed.measure import bench_speed
    from otwarp.bench.speed.table import table

    output = Output(out=out, as_json=as_json, plot=plot)
    found = bench_speed(cases=cases, device=device, rounds=rounds, seconds=seconds, scale=scale, note=note)

    def draw(file: Path) -> None:
        """The rows of this run."""
        from otwarp.bench.speed.figure import draw_speed

        draw_speed(found, file)

    output.report(found, lambda: print_table(table(found, f"Speed on {found.hardware}")), draw)
