"""`otwarp bench me`: what scenes cost on this machine."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.bench.options import Output, note, print_table
from otwarp.cli.options import device_option, json_option, out_option, with_options
from otwarp.cli.types import COUNT, SCENE, Number, OutputPath


@click.command()
@click.argument("scenes", type=SCENE, nargs=-1)
@click.option("--worlds", type=COUNT, metavar="N", help="Stepped at once; default: as many as fill the device.")
@click.option("--rounds", type=COUNT, default=3, show_default=True, help="Samples of each scene.")
@click.option(
    "--seconds",
    type=Number(0.0, 60.0, above=True, unit="s"),
    default=0.5,
    show_default=True,
    help="Length of one sample [s].",
)
@device_option
@with_options(out_option("FILE", "Write all numbers to FILE, JSON."), json_option)
@click.option("--plot", type=OutputPath(), metavar="PNG", help="Draw how much faster than the clock scenes run.")
def me(
    scenes: tuple[Path, ...],
    worlds: int | None,
    rounds: int,
    seconds: float,
    device: str | None,
    out: Path | None,
    as_json: bool,
    plot: Path | None,
) -> None:
    """What SCENES of yours cost on this machine: a step, a run, a thousand runs. Without any, some shipped ones."""
    from otwarp.bench.me.figure import draw
    from otwarp.bench.me.measure import bench_me
    from otwarp.bench.me.table import table

    output = Output(out=out, as_json=as_json, plot=plot)
    found = bench_me(scenes, device, worlds=worlds, rounds=rounds, seconds=seconds, note=note)
    output.report(found, lambda: print_table(table(found)), lambda file: draw(found, file))
