"""`otwarp import`: a mesh of a file becomes an obstacle of a scene."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli.options import force_option, json_option, mesh_scale_option, out_option
from otwarp.cli.output import check_new, json_text
from otwarp.cli.types import FILE, USD, Number
from otwarp.errors import InputError

if TYPE_CHECKING:
    from otwarp.scene.write.mesh_file import Surface

FORCES = "bodies touch it; the liquid passes: it neither slows what is near it nor turns a flow aside"
"""What the physics has of a mesh, and what it lacks."""


def _place(context: click.Context, parameter: click.Parameter, value: str) -> tuple[float, float, float]:
    """`X,Y,Z` as numbers."""
    number = Number(-1e6, 1e6, unit="µm")
    parts = [float(number.convert(part, parameter, context)) for part in value.split(",")]
    if len(parts) != 3:
        raise InputError(f"--position is {value}; allowed: X,Y,Z in µm, such as 0,0,10")
    return parts[0], parts[1], parts[2]


@click.command("import")
@click.argument("mesh", type=FILE)
@click.option("--into", type=FILE, metavar="SCENE", help="Scene that gets the obstacle; without, only the report.")
@mesh_scale_option
@click.option("--as", "kind", type=click.Choice(["solid", "chamber", "sheet"]), default="solid", show_default=True,
              help="What its surface bounds: a solid, a chamber around bodies, or nothing (a thin wall).")  # fmt: skip
@click.option("--simplify", type=Number(4, 10**7, whole=True), metavar="N", help="Reduce it to about N triangles.")
@click.option("--center", is_flag=True, help="Put its origin into the middle of its box.")
@click.option("--position", callback=_place, default="0,0,0", show_default=True, metavar="X,Y,Z",
              help="Where its origin goes [µm].")  # fmt: skip
@click.option("--name", metavar="NAME", help="Of its prim; default: that of the file.")
@out_option("FILE", "Write the scene here, and leave SCENE as it is.", endings=USD)
@force_option
@json_option
def import_(
    mesh: Path,
    into: Path | None,
    scale: float,
    kind: Any,
    simplify: int | None,
    center: bool,
    position: tuple[float, float, float],
    name: str | None,
    out: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Repair, check and, if wanted, simplify MESH (STL, OBJ, PLY), and make it an obstacle of a scene.

    The scene is written anew, whole, once it loads with the obstacle; comments in it are not kept.
    """
    from otwarp.scene.write.mesh_file import read_surface

    if into is not None and not into.is_file():
        raise InputError(f"--into is {into}, which is no file; allowed: a scene")
    if into is not None and out is None and into.suffix not in USD:
        said = f"--into is {into}: suffix = {into.suffix or '(none)'}"
        raise InputError(f"{said}; allowed: {', '.join(USD)} (others with --out)")
    if out is not None:
        if into is None:
            raise InputError(f"--out is {out}; allowed with --into SCENE")
        check_new(out, force=force)
    surface = read_surface(mesh, metres_per_unit=scale, kind=kind, center=center, simplify=simplify)
    prim = name or _name(mesh)
    if into is not None:
        from otwarp.scene.write.into import add_to_file

        add_to_file(into, prim, surface, position=position, out=out or into, force=force)
    if as_json:
        click.echo(json_text(_about(mesh, surface) | {"scene": into and str(out or into), "prim": into and prim}))
        return
    _print(mesh, surface)
    if into is not None:
        click.echo(f"wrote     {out or into}: obstacle {prim}; {FORCES}")


def _name(mesh: Path) -> str:
    """The file's name as that of a prim."""
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in mesh.stem)
    return name if name[:1].isalpha() else f"mesh_{name}"


def _about(mesh: Path, surface: Surface) -> dict[str, Any]:
    return {
        "mesh": str(mesh),
        "kind": surface.kind,
        "triangles": len(surface.triangles),
        "size": list(surface.size),
        "volume": surface.volume,
        "repairs": list(surface.repairs),
        "moved": surface.moved if math.isfinite(surface.moved) else None,
    }


def _print(mesh: Path, surface: Surface) -> None:
    from otwarp.scene.write.mesh_file import REACH

    x, y, z = surface.size
    click.echo(f"{mesh}: {surface.kind} of {len(surface.triangles):,} triangles, {x:.4g} × {y:.4g} × {z:.4g} µm"
               + (f", {surface.volume:.4g} µm³" if surface.volume else ", open"))  # fmt: skip
    for line in surface.repairs:
        click.echo(f"repaired  {line}")
    if surface.moved:
        far = f"up to {surface.moved:.2g}" if math.isfinite(surface.moved) else f"more than {REACH * max(x, y, z):.2g}"
        click.echo(f"simplified: its surface moved by {far} µm")
