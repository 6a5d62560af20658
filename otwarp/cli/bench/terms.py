"""`otwarp bench terms`: what every term of the step costs, on and off."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.bench.options import OUTPUT, Output, print_tables
from otwarp.cli.options import device_option, with_options
from otwarp.cli.types import COUNT, Number


@click.command()
@click.option(
    "--term", "names", multiple=True, metavar="NAME", help="Measure this term; may be repeated. Default: all."
)
@click.option("--rounds", type=COUNT, default=9, show_default=True, help="Pairs of samples of a term.")
@click.option(
    "--seconds",
    type=Number(0.0, 60.0, above=True, unit="s"),
    default=0.02,
    show_default=True,
    help="Length of one sample [s].",
)
@click.option(
    "--bodies",
    type=Number(64, whole=True),
    metavar="N",
    help="Bodies in all worlds together; default 4096, on CUDA 262144.",
)
@device_option
@with_options(*OUTPUT[:2])
def terms(
    names: tuple[str, ...],
    rounds: int,
    seconds: float,
    bodies: int | None,
    device: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Each term of the step by two scenes that differ by it, measured in turns; then several together.

    A scene pays for the terms it has: one that it lacks is neither compiled nor launched nor allocated.
    """
    from otwarp.bench.terms.measure import bench_terms
    from otwarp.bench.terms.table import tables

    output = Output(out=out, as_json=as_json)
    found = bench_terms(device, names=names, rounds=rounds, seconds=seconds, bodies=bodies)
    output.report(found, lambda: print_tables(tables(found)))
