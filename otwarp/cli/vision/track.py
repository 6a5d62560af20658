"""`otwarp vision track`: a body followed through the frames of a recorded run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from otwarp.cli.options import device_option, seed_option
from otwarp.cli.types import COUNT, FILE, Auto, Number, OutputPath
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.vision.networks.run import Estimator
    from otwarp.vision.rendering import Rendering
    from otwarp.vision.tracking.recorded import RecordedBody, Source


@click.command()
@click.argument("run", type=FILE)
@click.option("-o", "--out", type=OutputPath(folder=False), metavar="FILE",
              help="Gets the track, .nc, and beside it the picture, .png; default: RUN_track.nc here.")  # fmt: skip
@click.option("--net", type=FILE, metavar="RUN", help="A trained network, or its .onnx file, that looks at the frames.")
@click.option("--templates", is_flag=True, help="Look at the frames with rendered templates; so it is without --net.")
@click.option("--any-robot", is_flag=True, help="Go on with a network of another robot.")
@click.option("--camera", metavar="NAME", help="Of the scene; it has one.")
@click.option("--body", metavar="PRIM", help="Which is followed; default: the first robot.")
@click.option("--world", type=Number(0, whole=True), default=0, show_default=True, help="Of the recorded worlds.")
@click.option("--every", type=COUNT, default=1, show_default=True, metavar="N", help="Take one frame of N.")
@click.option("--frames", type=COUNT, metavar="N", help="At most so many; default: all.")
@click.option("--size", type=Number(16, 1024, whole=True), default=128, show_default=True, metavar="PIXELS",
              help="Side of the pieces of frames around the body; a network says its own.")  # fmt: skip
@click.option("--delay", type=Number(0.0, 10.0, unit="s"), default=0.0, show_default=True, metavar="SECONDS",
              help="From light to measurement.")  # fmt: skip
@click.option("--drop", type=Number(0.0, 0.9), default=0.0, show_default=True, metavar="SHARE",
              help="Of the frames, that is lost.")  # fmt: skip
@click.option("--rate", type=Number(0.0, 1e5, unit="Hz"), default=1000.0, show_default=True, metavar="HZ",
              help="Of predictions between frames; 0 for none.")  # fmt: skip
@click.option("--exposure", type=Number(0.0, 10.0, unit="s"), metavar="SECONDS",
              help="How long the shutter is open, while bodies move; default: the camera's.")  # fmt: skip
@click.option("--rings", type=Auto(1, whole=True), default="auto", show_default=True,
              help="Rings of source points over the condenser; auto: a lattice, as dense as depths need.")  # fmt: skip
@click.option("--thickness", type=Number(0.0, 10.0, above=True, unit="µm"), default=0.2, show_default=True,
              help="Of the slices through which light is led [µm].")  # fmt: skip
@seed_option
@device_option
def track(
    run: Path,
    out: Path | None,
    net: Path | None,
    templates: bool,
    any_robot: bool,
    camera: str | None,
    body: str | None,
    world: int,
    every: int,
    frames: int | None,
    size: int,
    delay: float,
    drop: float,
    rate: float,
    exposure: float | None,
    rings: int | Literal["auto"],
    thickness: float,
    seed: int,
    device: str | None,
) -> None:
    """Follow a body of a recorded RUN through what its camera sees, and compare with where it was.

    Each frame is rendered with the sensor's noise; templates or a network say how the body lies in it, and a filter
    that knows how the body moves in its traps makes a track of that.
    """
    from otwarp.cli import stop
    from otwarp.cli.progress import parts
    from otwarp.device import pick_device
    from otwarp.vision.networks import load
    from otwarp.vision.rendering import Rendering
    from otwarp.vision.tracking.figure import draw_track
    from otwarp.vision.tracking.recorded import RecordedBody, track_run
    from otwarp.vision.tracking.results import errors_of, rows_of, save_track
    from otwarp.vision.tracking.shape import Shape

    if net is not None and templates:
        raise InputError("--net and --templates are both given; allowed: one of them")
    file = out or Path(f"{run.resolve().name}_track.nc")
    if file.suffix != ".nc":
        raise InputError(f"--out is {file}; allowed: a file that ends with .nc")
    network = None if net is None else load(net, device=device)
    pick_device(device)
    recorded = RecordedBody.load(run, body, world=world, every=every, frames=frames, camera=camera, exposure=exposure,
                                 device=device)  # fmt: skip
    how = Rendering(rings=rings, thickness=thickness)
    stop.begin()
    source, size = _source(recorded, network, size, how, device, seed, any_robot)
    with parts("frame", "frames") as progress:
        steps = track_run(recorded, source, size=size, delay=delay, drop=drop, rate=rate, seed=seed, rendering=how,
                          device=device, progress=lambda n: progress(n, len(recorded)))  # fmt: skip
    shape = Shape.of(recorded.scene, recorded.body, recorded.reference())
    errors = errors_of(recorded, shape, steps)
    about = {"run": str(run), "source": str(net or "templates"), "delay": delay, "drop": drop, "seed": seed}
    save_track(file, recorded, steps, errors, **about)
    draw_track(file.with_suffix(".png"), recorded, steps, errors)
    click.echo(f"{recorded.body}: {len(steps)} frames, {errors.seen} measurements")
    _print_table([("", "seen", "track"), *rows_of(errors)])
    click.echo(f"wrote {file}")
    click.echo(f"look at {file.with_suffix('.png')}")


def _source(
    recorded: RecordedBody,
    network: Estimator | None,
    size: int,
    how: Rendering,
    device: str | None,
    seed: int,
    any_robot: bool,
) -> tuple[Source, int]:
    """What looks at the frames, a network or else templates; and the side of the pieces that it looks at [pixels]."""
    from otwarp.cli.progress import LONG, parts
    from otwarp.vision.tracking.recorded import check_size
    from otwarp.vision.tracking.source import measured, network_source, templates_for

    if network is not None:
        return network_source(recorded, network, any_robot=any_robot)
    check_size(recorded, size)
    with parts("tilt of the templates", "tilts of the templates") as progress:
        templates = templates_for(recorded, size, rendering=how, device=device, progress=progress)
    with parts("image of the templates' errors", "images of the templates' errors", after=LONG) as progress:
        return measured(recorded, templates, size, rendering=how, device=device, seed=seed, progress=progress), size


def _print_table(rows: list[tuple[str, str, str]]) -> None:
    """Columns as wide as what is in them."""
    widths = [max(len(row[k]) for row in rows) for k in range(3)]
    for name, seen, tracked in rows:
        click.echo(f"{name:<{widths[0]}}  {seen:>{widths[1]}}  {tracked:>{widths[2]}}".rstrip())
