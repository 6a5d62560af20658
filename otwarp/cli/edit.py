"""`otwarp edit`: a scene drawn in the browser."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli import stop
from otwarp.cli.options import scene_argument
from otwarp.cli.options.page import page_options
from otwarp.cli.types import OutputPath


@click.command()
@scene_argument
@click.option(
    "-o",
    "--out",
    type=OutputPath(),
    metavar="FILE",
    help="What is proposed to be saved; default: SCENE_edited.usda beside SCENE, of a shipped one in this folder. "
    "The page saves into its folder.",
)
@page_options
def edit(scene: Path, out: Path | None, theme: str, **where: object) -> None:
    """Open a page on SCENE: add, move, copy and delete traps, robots, cells, meshes, draw paths, save.

    SCENE itself is only written where the page is told to replace it. Ctrl-C ends the page.
    """
    from otwarp.view.serve import ServeOptions
    from otwarp.view.show import edit_scene

    edit_scene(scene, ServeOptions(**where), out=out, theme=theme, say=click.echo)  # type: ignore[arg-type]
    stop.check_terminated()  # Ctrl-C is how a page ends; SIGTERM has an exit code of its own
