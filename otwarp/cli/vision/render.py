"""`otwarp vision render`: what the microscope of a scene sees."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter as clock
from typing import Any, Literal

import click

from otwarp.cli.options import device_option, out_option, seed_option
from otwarp.cli.output import counted
from otwarp.cli.types import SCENE_OR_RUN, Auto, Number
from otwarp.errors import InputError

MOST_PLANES = 1000


def _planes(context: click.Context, parameter: click.Parameter, value: str) -> list[float]:
    """`-6:6:2` or `-1,0,2.5` as numbers."""
    allowed = "FROM:TO:STEP or numbers with commas, in µm, such as -6:6:2"
    try:
        if ":" not in value:
            found = [float(part) for part in value.split(",")]
        else:
            first, last, step = (float(part) for part in value.split(":"))
            count = round((last - first) / step) if step else 0
            if not 0 <= count < MOST_PLANES or abs(first + count * step - last) > 1e-6 * abs(step):
                raise ValueError
            found = [first + n * step for n in range(count + 1)]
    except (ValueError, OverflowError):
        raise InputError(f"--focus is {value}; allowed: {allowed}") from None
    if not all(abs(z) <= 1e4 for z in found):
        raise InputError(f"--focus is {value}; allowed: {allowed}, up to 1e4 µm away")
    return found


def _size(context: click.Context, parameter: click.Parameter, value: str | None) -> tuple[int, int] | None:
    if value is None:
        return None
    try:
        width, height = (int(n) for n in value.lower().split("x"))
    except ValueError:
        raise InputError(f"--size is {value}; allowed: WIDTHxHEIGHT in pixels, such as 224x224") from None
    if not (1 <= width <= 8192 and 1 <= height <= 8192):
        raise InputError(f"--size is {value}; allowed: 1x1 to 8192x8192")
    return width, height


def _named(bodies: tuple[str, ...]) -> str:
    """Some of them, and how many more there are."""
    return ", ".join(bodies[:4]) + (f" and {len(bodies) - 4} more" if len(bodies) > 4 else "")


@click.command()
@click.argument("path", type=SCENE_OR_RUN)
@click.option("--time", type=Number(0.0, unit="s"), default=0.0, show_default=True, metavar="SECONDS",
              help="When: a scene is simulated up to then, of a run the nearest frame is taken.")  # fmt: skip
@click.option("--exposure", type=Number(0.0, 10.0, unit="s"), metavar="SECONDS",
              help="How long the shutter is open from then on, while bodies move; default: the camera's.")  # fmt: skip
@click.option("--world", type=Number(0, whole=True), default=0, show_default=True, help="Of a recorded run.")
@click.option("--focus", callback=_planes, default="0", show_default=True, metavar="PLANES",
              help="Focal planes [µm] from the camera's own: FROM:TO:STEP, or numbers with commas.")  # fmt: skip
@click.option("--size", callback=_size, metavar="WxH", help="Pixels around the middle; default: the camera's frame, "
              "at most 256x256.")  # fmt: skip
@click.option("--center", metavar="PRIM", help="A body that is in the middle; default: the camera's middle.")
@click.option("--method", type=click.Choice(["two_index", "beam", "projection", "mie"]), default="two_index",
              show_default=True, help="Rung of the ladder; mie is exact, for spheres that do not overlap.")  # fmt: skip
@click.option("--thickness", type=Number(0.0, 10.0, above=True, unit="µm"), default=0.2, show_default=True,
              help="Of the slices [µm].")  # fmt: skip
@click.option("--rings", type=Auto(1, whole=True), default="auto", show_default=True,
              help="Rings of source points, 4 are 61; auto: a lattice as dense as the planes need.")  # fmt: skip
@click.option("--margin", type=Auto(0.0, 1000.0, unit="µm"), default="auto", show_default=True, metavar="UM",
              help="Around the image, where light is computed as well [µm]; auto: as the planes need.")  # fmt: skip
@out_option("FILE", "Gets the images: .png for panels, .tif for the sensor's grey levels, .npy for intensities.")
@seed_option
@device_option
def render(
    path: Path,
    time: float,
    exposure: float | None,
    world: int,
    focus: list[float],
    size: tuple[int, int] | None,
    center: str | None,
    method: str,
    thickness: float,
    rings: int | Literal["auto"],
    margin: float | Literal["auto"],
    out: Path | None,
    seed: int,
    device: str | None,
) -> None:
    """Draw what the microscope of a scene, or of a recorded run, sees.

    Light is led through the bodies as waves and through objective and condenser to the sensor, as OtCameraAPI says.
    """
    from otwarp.cli.progress import LONG, parts, said_if_long
    from otwarp.vision.moment import moments
    from otwarp.vision.pictures import picture
    from otwarp.vision.rendering import Rendering
    from otwarp.vision.stack import check_ending, save_stack

    begun = clock()
    file = out or Path(f"{path.resolve().stem}_microscope.png")
    check_ending(file)
    how = Rendering(method=method, thickness=thickness, rings=rings, margin=margin)
    with parts("step", "steps", after=LONG) as progress:
        seen = moments(path, time=time, world=world, seed=seed, device=device, center=center, exposure=exposure,
                       progress=progress)  # fmt: skip
    with said_if_long(f"computing {counted(len(focus), 'image')}"):
        found: Any = picture(seen, focus, size=size, center=center, rendering=how, seed=seed, device=device)
    save_stack(file, found.intensity, found.levels, found.focus, found.pixel, found.bits)
    high, wide = found.levels.shape[1:]
    click.echo(f"{counted(len(found.focus), 'focal plane')} of {wide} × {high} pixels of "
               f"{1e3 * found.pixel:g} nm, {counted(found.solids, 'solid')}, {counted(found.sources, 'source point')}, "
               f"a margin of {found.margin:.3g} µm, {clock() - begun:.2g} s")  # fmt: skip
    if found.error is not None:
        click.echo(f"for want of more source points off by up to {found.error.max():.1g} of the contrast")
    if found.cut:
        click.echo(f"cut by the edge of the image: {_named(found.cut)}")
    if found.left_out:
        click.echo(f"left out, as they reach beyond the margin: {_named(found.left_out)}")
    click.echo(f"wrote {file}")
