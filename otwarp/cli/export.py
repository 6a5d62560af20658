"""`otwarp export`: a scene or a recorded run in another form."""

from __future__ import annotations

from pathlib import Path

import click

from otwarp.cli.options import out_option
from otwarp.cli.types import SCENE_OR_RUN, Number
from otwarp.errors import InputError

USD = (".usda", ".usdc", ".usd")
"""Endings of a USD file."""


@click.command()
@click.argument("path", type=SCENE_OR_RUN)
@out_option("FILE", "File to write: .usda, .usdc, .usd, or .glb for glTF; default: NAME.usdc in this folder.")
@click.option("--meters", is_flag=True, help="Lengths in metres, for programs that insist; else in micrometres.")
@click.option(
    "--meshes",
    is_flag=True,
    help="USD: meshes in place of spheres, cylinders and so on, for programs that draw these without materials, such "
    "as Blender. The file is a drawing then, and no scene.",
)
@click.option(
    "--fps",
    type=Number(0.0, 1e6, above=True, unit="Hz"),
    default=30.0,
    show_default=True,
    help="glTF: poses per simulated second, at most those recorded.",
)
@click.option("--forces", is_flag=True, help="glTF: with recorded force arrows; USD has them as guides.")
@click.pass_context
def export(
    context: click.Context, path: Path, out: Path | None, meters: bool, meshes: bool, fps: float, forces: bool
) -> None:
    """Write PATH, a USD stage or the output folder of `otwarp run`, as one file for other programs.

    What is recorded moves in it, and what has no looks gets some.
    """
    from otwarp.scene import export_gltf, export_stage
    from otwarp.scene.drawing.files import stage_file

    file = stage_file(path)
    out = out or Path(f"{path.stem if path.is_file() else path.resolve().name}.usdc")
    glb = out.suffix == ".glb"
    if not glb and out.suffix not in USD:
        raise InputError(f"--out is {out}; allowed: a file that ends in {', '.join(USD)} or .glb")
    if out.exists() and out.samefile(file):
        raise InputError(f"--out is {out}, which is what is exported; allowed: another file")
    _check_use(context, glb)
    if glb:
        written = export_gltf(file, out, fps=fps, metres=meters, forces=forces)
    else:
        written = export_stage(file, out, metres=meters, meshes=meshes)
    click.echo(f"wrote {written}")


def _check_use(context: click.Context, glb: bool) -> None:
    """Refuse options that mean nothing for this kind of file."""
    for name in ("meshes",) if glb else ("fps", "forces"):
        if context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            kinds = ("glTF (.glb)", "USD") if glb else ("USD", "glTF (.glb)")
            raise InputError(f"--{name} with a {kinds[0]} file means nothing; allowed: with {kinds[1]}")
