"""`otwarp vision dataset`: render a data set, or go on with it."""

from __future__ import annotations

import os
from pathlib import Path

import click

from otwarp.cli import stop
from otwarp.cli.options import device_option
from otwarp.cli.types import COUNT, DATASET, OutputPath


@click.command()
@click.argument("file", type=DATASET)
@click.option("-o", "--out", type=OutputPath(folder=True), metavar="DIR",
              help="Folder of the data set; default: out/vision/FILE.")  # fmt: skip
@click.option("--processes", type=COUNT, metavar="N",
              help="That render side by side on a CPU; default: one for every core.")  # fmt: skip
@click.option("--plan", "plan_only", is_flag=True, help="Say what it will cost, and render nothing.")
@device_option
def dataset(file: Path, out: Path | None, processes: int | None, plan_only: bool, device: str | None) -> None:
    """Render the data set that FILE describes. The same line goes on after whatever ended it.

    Images do not depend on the number of processes or on interruptions.
    """
    from otwarp.device import pick_device
    from otwarp.vision.datasets import labels_of, load_spec, make_dataset

    on_cpu = pick_device(device).is_cpu
    count = processes or (_cores() if on_cpu else 1)
    labels = labels_of(load_spec(file))
    folder = out or Path("out") / "vision" / file.stem
    _say_plan(labels, count, device)
    if plan_only:
        return
    stop.begin()
    from otwarp.cli.progress import parts

    with parts("pose", "poses") as progress:
        make_dataset(labels, folder, processes=count, device=device, progress=progress)
    click.echo(f"wrote {folder}: README.md says what it holds")
    click.echo(f"look at {folder / 'samples.png'}")


def _say_plan(labels: object, processes: int, device: str | None) -> None:
    from otwarp.vision.datasets.labels import Labels
    from otwarp.vision.datasets.plan import plan_of

    assert isinstance(labels, Labels)
    found, spec = plan_of(labels, device), labels.spec
    together = "" if processes == 1 else f" with {min(processes, found.poses)} processes"
    click.echo(f"{found.poses} poses, {found.images} images of {spec.width} × {spec.height} pixels, "
               f"{found.bytes / 1e6:.3g} MB before compression")  # fmt: skip
    click.echo(
        f"{found.sources} source points, a margin of {found.margin:.2g} µm; a pose takes {found.pose_seconds:.2g} s, "
        f"an image {1e3 * found.image_seconds:.2g} ms: about {_duration(found.seconds(processes))}{together}"
    )


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.2g} s"
    return f"{seconds / 60.0:.2g} min" if seconds < 5400.0 else f"{seconds / 3600.0:.2g} h"


def _cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
