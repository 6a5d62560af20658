"""`otwarp mobility`: how the bodies of a scene diffuse, and how well that is known."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from otwarp.cli.options import json_option, out_option, scene_argument
from otwarp.cli.output import json_text, tables_console, write_json
from otwarp.cli.types import Number

if TYPE_CHECKING:
    from otwarp.hydrodynamics import BodyMobility
    from otwarp.scene import Body, Scene


@click.command()
@scene_argument
@click.option(
    "--accuracy",
    type=Number(0.0, 0.5),
    metavar="X",
    help="Wanted relative error, 0 for the pair mobilities of the spheres alone; default: what each body asks for.",
)
@out_option("FILE", "Write all numbers to FILE, JSON.")
@json_option
def mobility(scene: Path, accuracy: float | None, out: Path | None, as_json: bool) -> None:
    """Print diffusion along principal axes, centre of diffusion and error of each distinct body of SCENE."""
    from otwarp.scene import Scene
    from otwarp.simulation.packing.bodies import mobilities

    loaded = Scene.load(scene)
    if accuracy is not None:
        bodies = tuple(dataclasses.replace(b, mobility_accuracy=accuracy) for b in loaded.bodies)
        loaded = dataclasses.replace(loaded, bodies=bodies)
    rows = _distinct(loaded, mobilities(loaded))
    about = {"scene": str(scene), "bodies": rows}
    if as_json:
        click.echo(json_text(about))
    else:
        _print(rows, loaded.root)
    if out is not None:
        write_json(about, out)


def describe(move: BodyMobility, energy_over_viscosity: float) -> dict[str, Any]:
    """Diffusion of one body, ready for JSON.

    Args:
        move: Its geometric mobility.
        energy_over_viscosity: k_B T over the viscosity [µm³/s].

    Returns:
        Coefficients [µm²/s, rad²/s] with their axes in the prim's frame, fastest first, the centre of diffusion [µm],
        the estimated relative error (None where nothing estimates it), and the number of surface blobs.
    """
    import numpy as np

    out: dict[str, Any] = {}
    for name, block in (("translation", move.mobility[:3, :3]), ("rotation", move.mobility[3:, 3:])):
        values, axes = np.linalg.eigh(block)
        axes = axes * np.where(axes[np.argmax(np.abs(axes), axis=0), range(3)] < 0.0, -1.0, 1.0)
        out[name] = {
            "coefficients": [energy_over_viscosity * float(v) for v in values[::-1]],
            "axes": axes.T[::-1].tolist(),
        }
    out["centre_of_diffusion"] = move.reference.tolist()
    out["estimated_error"] = float(move.error) if np.isfinite(move.error) else None
    out["blobs"] = move.blobs
    return out


def _distinct(scene: Scene, moves: list[BodyMobility]) -> list[dict[str, Any]]:
    """One row for each kind: bodies that share a mobility and look the same count once."""
    from otwarp.units import BOLTZMANN

    rate = BOLTZMANN * scene.medium.temperature / scene.medium.viscosity
    same: dict[tuple[int, int, int], list[tuple[Body, BodyMobility]]] = {}
    for body, move in zip(scene.bodies, moves, strict=True):
        same.setdefault((id(move), len(body.spheres), len(body.rods)), []).append((body, move))
    return [
        {
            "bodies": list(dict.fromkeys(body.prim for body, _ in group)),
            "count": len(group),
            "spheres": len(group[0][0].spheres),
            "rods": len(group[0][0].rods),
            "accuracy": group[0][0].mobility_accuracy,
            **describe(group[0][1], rate),
        }
        for group in same.values()
    ]


def _print(rows: list[dict[str, Any]], root: str) -> None:
    from rich.table import Table

    columns = ("bodies", "spheres, rods", "D_t (µm²/s)", "D_r (rad²/s)", "centre of diffusion (µm)", "error", "blobs")
    table = Table(*columns, title="Diffusion along principal axes, fastest first")
    for row in rows:
        name = row["bodies"][0].removeprefix(root.rstrip("/") + "/")
        error = row["estimated_error"]
        table.add_row(
            name if row["count"] == 1 else f"{name} + {row['count'] - 1}",
            f"{row['spheres']}, {row['rods']}",
            *("  ".join(f"{d:.4g}" for d in row[key]["coefficients"]) for key in ("translation", "rotation")),
            "  ".join(f"{round(x, 4) + 0.0:.4f}" for x in row["centre_of_diffusion"]),
            "not estimated" if error is None else "exact" if error == 0.0 else f"{100.0 * error:.2g} %",
            str(row["blobs"]) if row["blobs"] else "–",
        )
    tables_console(160).print(table)
