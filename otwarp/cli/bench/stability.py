"""`otwarp bench stability`: what happens to scenes that are hard to step."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from otwarp.cli.bench.options import OUTPUT, Output, note
from otwarp.cli.options import device_option, with_options

EXIT_WRONG = 1


@click.command()
@click.option("--grid", "grids", multiple=True, metavar="NAME", help="Run this grid; may be repeated. Default: all.")
@click.option("--quick", is_flag=True, help="Fewer worlds and scenes: three minutes on two cores.")
@click.option("--long", is_flag=True, help="Also runs of 10⁸ steps.")
@click.option(
    "--processes", type=click.IntRange(min=1), default=1, metavar="N", help="Cells that run at a time. Default: 1."
)
@device_option
@with_options(*OUTPUT[:2])
def stability(
    grids: tuple[str, ...],
    quick: bool,
    long: bool,
    processes: int,
    device: str | None,
    out: Path | None,
    as_json: bool,
) -> int:
    """Stress tests: time step, power, stiffness, sizes, overlaps, trap jumps, temperature, long runs, random scenes.

    One letter per cell says whether the run was accurate against a closed form, stable with a stated error, refused or
    stopped with a clear error. Exit code 1 if any cell is silently wrong.
    """
    from otwarp.bench.stability.measure import bench_stability
    from otwarp.bench.stability.table import plain

    output = Output(out=out, as_json=as_json)
    found = bench_stability(grids=grids, device=device, quick=quick, long=long, processes=processes, note=note)
    if sys.stderr.isatty():
        click.echo("\r\x1b[K", nl=False, err=True)
    output.report(found, lambda: click.echo(plain(found)))
    return EXIT_WRONG if found.wrong else 0
