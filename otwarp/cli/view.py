"""`otwarp view`: recorded runs in the browser."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli import stop
from otwarp.cli.options.page import page_options
from otwarp.cli.types import FILE, Number
from otwarp.errors import InputError


@click.command(
    epilog="""\b
Examples:
  otwarp view out/cell_delivery                   # play it back
  otwarp view out/cell_delivery out/fast          # compare: the second one translucent, plots over each other
  otwarp view out/cell_delivery --theme light     # for slides
  otwarp view take1.mcap                          # a session that `otwarp teleop --record` wrote
  otwarp view out/capture                         # a study: click on a point of its map, and see one of its trials"""
)
@click.argument("paths", type=FILE, nargs=-1, required=True, metavar="RUN [RUN] | SESSION | STUDY")
@click.option("--world", type=Number(0, whole=True), default=0, show_default=True, help="Which recorded world.")
@click.option("--scene", type=FILE, help="Where the scene of a session is now; default: where it was.")
@page_options
def view(paths: tuple[Path, ...], world: int, scene: Path | None, theme: str, **where: object) -> None:
    """Open a page on RUN, the folder of a recorded run: play it, step through it, measure in it, compare two.

    SESSION is an MCAP recording of a live session, or a ROS bag that was made of one.

    Of STUDY, the folder of a study, it shows the map; a trial of a point that is clicked on is run again from its seed.

    The page only reads. Ctrl-C ends it.
    """
    from otwarp.view.serve import ServeOptions
    from otwarp.view.show import show_runs, show_study

    if scene is not None and not scene.is_file():
        raise InputError(f"--scene is {scene}, which is no file; allowed: the scene of a session")
    if len(paths) > 2:
        raise InputError(f"{len(paths)} runs; allowed: one, or two to compare")
    if any((path / "study.json").exists() for path in paths):
        if len(paths) > 1:
            raise InputError(f"{len(paths)} folders, one of them a study; allowed: a study alone, or two runs")
        show_study(paths[0], ServeOptions(**where), theme=theme, say=click.echo)  # type: ignore[arg-type]
    else:
        show_runs(paths, ServeOptions(**where), world=world, scene=scene, theme=theme, say=click.echo)  # type: ignore[arg-type]
    stop.check_terminated()  # Ctrl-C is how a page ends; SIGTERM has an exit code of its own
