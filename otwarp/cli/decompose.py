"""`otwarp decompose`: a closed mesh as spheres."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli.options import json_option, mesh_scale_option, out_option
from otwarp.cli.output import json_text, tables_console
from otwarp.cli.types import COUNT, FILE, FRACTION, USD

if TYPE_CHECKING:
    from otwarp.hydrodynamics.decomposition import Decomposition
    from otwarp.scene import Body


@click.command()
@click.argument("mesh", type=FILE)
@click.option("-n", "--spheres", type=COUNT, metavar="N", help="At most how many spheres.")
@click.option(
    "--volume-error",
    type=FRACTION,
    metavar="X",
    help="As many spheres as it takes to misplace no more than this part of the volume; default, without -n: 0.1.",
)
@mesh_scale_option
@out_option("FILE", "USD file for the body.", endings=USD)
@json_option
def decompose(
    mesh: Path,
    spheres: int | None,
    volume_error: float | None,
    scale: float,
    out: Path | None,
    as_json: bool,
) -> None:
    """Turn a closed MESH (STL, OBJ, PLY, …) into spheres for optical forces, and say how well they stand for it."""
    from otwarp.hydrodynamics.decomposition import decompose as run

    found = run(mesh, spheres=spheres, volume_error=volume_error, metres_per_unit=scale)
    about = _describe(mesh, found)
    if out is not None:
        from otwarp.scene.write.body_file import write_body

        write_body(_body(mesh, found), out)
    if as_json:
        click.echo(json_text(about))
        return
    _print(about)
    if out is not None:
        click.echo(f"wrote {out}: prim {_body(mesh, found).prim}, for a scene to reference")


def _body(mesh: Path, found: Decomposition) -> Body:
    from otwarp.scene import Body, Sphere

    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in mesh.stem)
    path = "/" + (name if name[:1].isalpha() else f"body_{name}")
    rows = zip(found.centres.tolist(), found.radii.tolist(), strict=True)
    spheres = tuple(Sphere(prim=f"{path}/sphere_{k}", offset=(*c,), radius=r) for k, (c, r) in enumerate(rows))
    return Body(prim=path, spheres=spheres)


def _describe(mesh: Path, found: Decomposition) -> dict[str, Any]:
    from otwarp.cli.mobility import describe
    from otwarp.scene import Medium
    from otwarp.units import BOLTZMANN

    water = Medium()
    rate = BOLTZMANN * water.temperature / water.viscosity
    rows = zip(found.centres.tolist(), found.radii.tolist(), strict=True)
    return {
        "mesh": str(mesh),
        "spheres": [{"centre": c, "radius": r} for c, r in rows],
        "volume": found.volume,
        "volume_error": found.volume_error,
        "excess_volume": found.excess,
        "mobility_error": found.mobility_error,
        "spheres_mobility": describe(found.mobility, rate),
        "mesh_mobility": describe(found.mesh_mobility, rate),
    }


def _print(about: dict[str, Any]) -> None:
    from rich.table import Table

    console = tables_console(120)
    table = Table("sphere", "x (µm)", "y (µm)", "z (µm)", "radius (µm)", title=f"Spheres for {about['mesh']}")
    for k, row in enumerate(about["spheres"]):
        table.add_row(str(k), *(f"{round(x, 4) + 0.0:.4f}" for x in (*row["centre"], row["radius"])))
    console.print(table)
    quality = Table("quantity", "value", title="How well they stand for it", show_header=False)
    quality.add_row("volume of the mesh", f"{about['volume']:.4g} µm³")
    quality.add_row("volume of the spheres' union", f"{100.0 * about['excess_volume']:+.2g} %")
    quality.add_row("volume in one but not in both", f"{100.0 * about['volume_error']:.2g} %")
    quality.add_row("mobility, against the mesh's", f"{100.0 * about['mobility_error']:.2g} %")
    for key, name in (("spheres_mobility", "spheres"), ("mesh_mobility", "mesh")):
        for kind, unit in (("translation", "µm²/s"), ("rotation", "rad²/s")):
            values = "  ".join(f"{d:.4g}" for d in about[key][kind]["coefficients"])
            quality.add_row(f"{kind}al diffusion of the {name} in water at 25 °C", f"{values} {unit}")
    console.print(quality)
