"""`otwarp preview`: draw a scene or a recorded run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from otwarp.cli.options import device_option, out_option
from otwarp.cli.types import MOVIE, SCENE_OR_RUN, Number, OutputPath
from otwarp.errors import InputError


def _size(context: click.Context, parameter: click.Parameter, value: str | None) -> tuple[int, int] | None:
    if value is None:
        return None
    try:
        width, height = (int(n) for n in value.lower().split("x"))
    except ValueError as error:
        raise InputError(f"--size is {value!r}; allowed: WIDTHxHEIGHT, such as 1280x720") from error
    return width, height


@contextmanager
def _progress_bar() -> Iterator[Callable[[int, int], None] | None]:
    """A bar over the pictures of a movie on standard error, or nothing when that is not a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("drawing", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@click.command()
@click.argument("path", type=SCENE_OR_RUN)
@out_option("PNG", "Picture to write; default: NAME.png in this folder.")
@click.option(
    "--frame", type=Number(0, whole=True), help="Frame of the run or of the stage's time codes; default: the first."
)
@click.option(
    "--time", type=Number(0.0, unit="s"), metavar="SECONDS", help="Instead of a frame: seconds from the start."
)
@click.option(
    "--movie",
    type=OutputPath(endings=MOVIE),
    metavar="FILE",
    # measured with single_bead, cell_delivery and teleop_small at 640x360
    help="Write a movie of the whole run, .gif, .mp4 or .webm: at most 150 pictures, of 0.3 to 1.4 s each on two CPU "
    "cores; a bar on the terminal, if standard error is one, says how far it is.",
)
@click.option("--camera", metavar="PRIM", help="Camera prim; default: the stage's first camera.")
@click.option("--forces", is_flag=True, help="Draw recorded force arrows.")
@click.option(
    "--style",
    type=click.Choice(["dark", "light", "white"]),
    default="dark",
    show_default=True,
    help="Background: for a dark slide, a light one, or print.",
)
@click.option("--size", callback=_size, help="Size in pixels; default: 1280x720, for a movie 640x360.")
@device_option
def preview(
    path: Path,
    out: Path | None,
    frame: int | None,
    time: float | None,
    movie: Path | None,
    camera: str | None,
    forces: bool,
    style: str,
    size: tuple[int, int] | None,
    device: str | None,
) -> None:
    """Draw PATH, a USD stage or the output folder of `otwarp run`, through the stage's own camera.

    Needs neither a display nor a GPU.
    """
    from otwarp.preview.draw import preview as draw

    if out is None and movie is None:
        out = Path(f"{path.stem if path.is_file() else path.resolve().name}.png")
    with _progress_bar() as progress:
        written = draw(
            path,
            out,
            frame=frame,
            time=time,
            size=size or ((640, 360) if movie is not None else (1280, 720)),
            camera=camera,
            movie=movie,
            forces=forces,
            style=style,
            device=device,
            progress=progress,
        )
    for file in written:
        click.echo(f"wrote {file}")
