"""`otwarp bench integrators`: error against run time of integrators, force models and precisions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.bench.options import OUTPUT, Output, bead, check_same, note, print_tables
from otwarp.cli.options import device_option, with_options
from otwarp.cli.options.bead import Bead, taken
from otwarp.cli.types import COUNT, SECONDS


@click.command(params=bead())
@click.option(
    "--axis",
    "axes",
    multiple=True,
    metavar="NAME",
    help="integrator, force or precision; may be repeated. Default: all.",
)
@click.option("--worlds", type=COUNT, help="Beads of all measurements; default: as many as suit device and budget.")
@click.option("--seconds", type=SECONDS, default=60.0, show_default=True, help="Budget of all errors together [s].")
@click.option("--rounds", type=COUNT, default=7, show_default=True, help="Repeats of each run time.")
@click.option("--fast-math", is_flag=True, help="Approximate instructions on CUDA.")
@device_option
@with_options(*OUTPUT)
def integrators(**typed: Any) -> None:
    """Error against run time of integrators, then of force models and precisions, for one bead in a tabulated trap.

    Stationary variances and correlations in a well of 20 k_BT, and the mean escape time from one of 5 k_BT, against
    the Fokker–Planck equation with the same force. A run of an hour has a tenth of the statistical error of the
    default one; runs on different devices go into one picture by --with.
    """
    from otwarp.bench.integrators.measure import bench_integrators
    from otwarp.bench.integrators.result import IntegratorsBench
    from otwarp.bench.integrators.table import tables

    output: Output = taken(Output, typed)
    earlier = [IntegratorsBench.read(file) for file in output.others]
    beam, sphere = taken(Bead, typed).optics(1.0)
    check_same(beam, sphere, output.others, earlier)
    found = bench_integrators(beam, sphere, note=note, **typed)

    def draw(file: Path) -> None:
        """This run and the earlier ones."""
        from otwarp.bench.integrators.figure import draw_integrators

        draw_integrators([found, *earlier], file)

    output.report(found, lambda: print_tables(tables(found)), draw)
