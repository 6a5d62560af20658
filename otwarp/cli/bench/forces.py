"""`otwarp bench forces`: error against run time of every force model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from otwarp.cli.bench.options import OUTPUT, Output, bead, check_same, note, print_table
from otwarp.cli.options import device_option, with_options
from otwarp.cli.options.bead import Bead, taken
from otwarp.cli.types import COUNT, POSITIVE, SECONDS


@click.command(params=bead())
@click.option("--power", type=POSITIVE, default=20.0, show_default=True, help="Power in the medium [mW].")
@click.option(
    "--model", "models", multiple=True, metavar="NAME", help="Measure this model; may be repeated. Default: all."
)
@click.option("--worlds", type=COUNT, help="Beads; default: 4096 on a CPU, 1048576 on a GPU.")
@click.option("--rounds", type=COUNT, default=7, show_default=True, help="Repeats of each figure.")
@click.option("--time-step", type=SECONDS, metavar="SECONDS", help="The same for all models; default: k·dt/γ = 0.02.")
@click.option("--fast-math", is_flag=True, help="Approximate instructions on CUDA.")
@device_option
@with_options(*OUTPUT)
def forces(power: float, **typed: Any) -> None:
    """Error against run time of every force model, for one bead in one trap.

    Each model runs in the same step that otwarp run takes, with Brownian noise, in many worlds; its error is that of
    the force which the running simulation feels, against exact forces. Tables come from the cache, or are built: those
    of small tolerance take minutes.
    """
    from otwarp.bench.forces.measure import bench_forces
    from otwarp.bench.forces.result import ForcesBench
    from otwarp.bench.forces.table import table

    output: Output = taken(Output, typed)
    earlier = [ForcesBench.read(file) for file in output.others]
    beam, sphere = taken(Bead, typed).optics(power)
    check_same(beam, sphere, output.others, earlier)
    found = bench_forces(beam, sphere, note=note, **typed)

    def draw(file: Path) -> None:
        """This run and the earlier ones."""
        from otwarp.bench.forces.figure import draw_runs

        draw_runs([found, *earlier], file)

    output.report(found, lambda: print_table(table(found, f"Force models on {found.hardware}")), draw)
