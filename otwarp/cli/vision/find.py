"""`otwarp vision find`: the robots in a frame, and how each of them lies."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli.options import device_option, json_option
from otwarp.cli.types import FILE, Number, OutputPath
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.vision.tracking.looking import Sighting


@click.command()
@click.argument("image", type=FILE)
@click.option("-o", "--out", type=OutputPath(folder=False), metavar="FILE",
              help="Gets the table, .csv, and beside it the picture, .png; default: IMAGE_found.csv here.")  # fmt: skip
@click.option("--net", type=FILE, metavar="RUN",
              help="A trained network, or its .onnx file, that says how each lies; else places alone.")  # fmt: skip
@click.option("--pixel", type=Number(0.0, 100.0, above=True, unit="µm"), metavar="UM",
              help="Of the image [µm]; default: the network's.")  # fmt: skip
@click.option("--page", type=Number(0, 1_000_000, whole=True), default=0, show_default=True,
              help="Of an image file with several, from 0.")  # fmt: skip
@click.option("--join", type=Number(0.0, 10_000.0, unit="pixels"), default=0.0, show_default=True, metavar="PIXELS",
              help="Distance up to which pieces are one robot, as spheres without rods.")  # fmt: skip
@click.option("--scale", type=Number(0.0, 1000.0, above=True, unit="pixels"), default=4.0, show_default=True,
              metavar="PIXELS", help="Width of a fringe, over which contrast is smoothed.")  # fmt: skip
@click.option("--smallest", type=Number(0.0, 10_000.0, above=True, unit="pixels"), default=6.0, show_default=True,
              metavar="PIXELS", help="Least side of what counts.")  # fmt: skip
@click.option("--threshold", type=Number(0.0, 10_000.0, above=True), default=8.0, show_default=True, metavar="SIGMAS",
              help="Standard deviations above the noise, from which on something is there.")  # fmt: skip
@json_option
@device_option
def find(
    image: Path,
    out: Path | None,
    net: Path | None,
    pixel: float | None,
    page: int,
    as_json: bool,
    device: str | None,
    **chosen: float,
) -> None:
    """Find the robots in the frame IMAGE (grey .tif, .png or .npy), cut a piece around each, and say how it lies.

    Places are of the first pixel's middle in pixels, and of the middle pixel in µm; x goes right and y up.
    """
    from otwarp.vision.networks import load
    from otwarp.vision.networks.learnt import robot_of
    from otwarp.vision.networks.library import check_device_name
    from otwarp.vision.stack import load_stack
    from otwarp.vision.tracking.looking import draw_sightings, save_table, sightings

    file = out or Path(f"{image.resolve().stem}_found.csv")
    if file.suffix != ".csv":
        raise InputError(f"--out is {file}; allowed: a file that ends with .csv")
    check_device_name(device)
    pages = load_stack(image)
    if page >= len(pages):
        raise InputError(f"--page is {page}; allowed: 0 to {len(pages) - 1}, the images of {image}")
    network = None if net is None else load(net, device=device)
    seen = sightings(pages[page], network, pixel=pixel, **chosen)
    picture = draw_sightings(file.with_suffix(".png"), pages[page], seen)
    save_table(file, seen)
    if as_json:
        click.echo(json.dumps({"image": str(image), "robots": [_finite(s.row()) for s in seen]}, ensure_ascii=False))
        return
    if network is not None and "robot" in network.about:
        robot = robot_of(network.about)
        name = robot.name or "the robot of its data set"
        click.echo(f"the network takes each for {name}: {len(robot.radius)} solids, {robot.length:.3g} µm long")
    click.echo(f"{len(seen)} found in {pages.shape[2]} × {pages.shape[1]} pixels")
    for n, one in enumerate(seen, start=1):
        click.echo(f"{n}: {_said(one)}")
    click.echo(f"wrote {file}")
    click.echo(f"look at {picture}")


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    """What JSON can say: None for the variance of what was not measured."""
    return {k: None if isinstance(v, float) and v == float("inf") else v for k, v in row.items()}


def _said(one: Sighting) -> str:
    """A body in a line, with two standard deviations."""
    row = one.row()
    words = [f"column {row['column']:.1f}, row {row['row']:.1f}"]
    for name, unit in (("x", "um"), ("y", "um"), ("depth", "um"), ("tilt", "deg"), ("yaw", "deg")):
        if f"{name}_{unit}" in row:
            sigma = row.get(f"sd_{name}_{unit}", float("inf"))
            spread = f" ± {2.0 * sigma:.2g}" if sigma < float("inf") else ""
            words.append(f"{name} {row[f'{name}_{unit}']:.4g}{spread}{' µm' if unit == 'um' else '°'}")
    return ", ".join(words) + (f" ({one.note})" if one.note else "")
