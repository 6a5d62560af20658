"""Adds an obstacle to a scene that is a file: the file is written anew, whole, once the scene still loads."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene.appearance.materials import Materials
from otwarp.scene.description import IDENTITY, Obstacle
from otwarp.scene.read.load import read_stage
from otwarp.scene.read.source import open_stage
from otwarp.scene.track import Track
from otwarp.scene.write.export import export_layer
from otwarp.scene.write.mesh_file import Surface
from otwarp.scene.write.obstacles import define_obstacle

MICROMETRE = 1e-6
WRITABLE = (".usda", ".usdc", ".usd")
COLOR = (0.5, 0.62, 0.8)
OPACITY = {"solid": 1.0, "chamber": 0.15, "sheet": 0.5}
"""Of a chamber one wants to see what is in it."""


def mesh_obstacle(prim: str, surface: Surface, position: Sequence[float] = (0.0, 0.0, 0.0)) -> Obstacle:
    """A mesh as the description of an obstacle at rest.

    Args:
        prim: Path of its prim.
        surface: What `mesh_file.read_surface` gave.
        position: Where the mesh's origin is [µm].
    """
    return Obstacle(
        prim=prim,
        shape="mesh",
        position=Track.constant(position),
        orientation=Track.constant(IDENTITY),
        vertices=surface.vertices,
        triangles=surface.triangles,
        double_sided=surface.kind == "sheet",
    )


def add_to_file(
    file: Path, prim: str, surface: Surface, *, position: Sequence[float], out: Path, force: bool = False
) -> Path:
    """Add a mesh to the scene in `file` as an obstacle.

    Args:
        file: The scene; comments in it are not kept.
        prim: Name of the new prim, a child of the default prim.
        surface: The mesh.
        position: Where its origin goes, in world coordinates [µm].
        out: Where the scene is written, `file` itself or another one.
        force: Whether a prim of that path is replaced.

    Raises:
        InputError: A prim of that path is there, or the scene is refused with the mesh, as where bodies overlap it.
    """
    if file.suffix.lower() not in WRITABLE:
        raise InputError(f"{file}: suffix = {file.suffix or '(none)'}; allowed: {', '.join(WRITABLE)}")
    stage = open_stage(file)
    layer = stage.GetRootLayer()
    try:  # in the layer itself, from which its references are found; the file is as it was until it is replaced
        _define(stage, file, prim, surface, position, force)
        read_stage(stage, file=str(file))
        return export_layer(layer, out)
    finally:
        layer.Reload(force=True)


def _define(stage: Usd.Stage, file: Path, prim: str, surface: Surface, position: Sequence[float], force: bool) -> None:
    """Author the obstacle and its looks."""
    root = stage.GetDefaultPrim().GetPath()
    if not Sdf.Path.IsValidIdentifier(prim):
        raise InputError(f"--name is {prim}; allowed: letters, digits and _, not beginning with a digit")
    path = root.AppendChild(prim)
    if stage.GetPrimAtPath(path):
        if not force:
            raise InputError(f"{file}: {path} is there already; allowed: another --name, or --force to replace it")
        stage.RemovePrim(path)
    unit = UsdGeom.GetStageMetersPerUnit(stage) / MICROMETRE
    obstacle = mesh_obstacle(str(path), surface, tuple(np.asarray(position, dtype=float) / unit))
    if unit != 1.0:
        obstacle = dataclasses.replace(obstacle, vertices=surface.vertices / unit)
    made = define_obstacle(stage, path, obstacle, stage.GetTimeCodesPerSecond())
    if UsdGeom.XformCache().GetParentToWorldTransform(made) != Gf.Matrix4d(1.0):
        UsdGeom.Xformable(made).SetResetXformStack(True)  # its place is one in the world
    looks, opacity = Materials(stage, str(root)), OPACITY[surface.kind]
    looks.paint(made, COLOR, opacity)
    looks.bind(made, COLOR, opacity)
