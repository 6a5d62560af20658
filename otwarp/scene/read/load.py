"""Reads a USD stage into the fields of a `Scene`: one pass that sorts the prims, then one reader for each kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pxr import Sdf, Usd, UsdGeom

from otwarp.scene.check.overlap import OVERLAP_TOLERANCE
from otwarp.scene.check.scene import check_scene
from otwarp.scene.description import Body, Obstacle
from otwarp.scene.read.attributes import check_prim
from otwarp.scene.read.bodies import read_cell, read_instances, read_robot
from otwarp.scene.read.diagnostics import reading
from otwarp.scene.read.environment import read_camera, read_flow, read_goal, read_medium, read_settings
from otwarp.scene.read.lenses import check_lens
from otwarp.scene.read.obstacles import is_collider, read_obstacle
from otwarp.scene.read.remarks import remarks
from otwarp.scene.read.source import Source, open_stage
from otwarp.scene.read.traps import read_trap

_BODIES = ("OtBodyAPI", "OtCellAPI")
_ELEMENTS = ("OtSphereAPI", "OtRodAPI")


def read_file(path: Path, *, duration: float | None = None) -> dict[str, Any]:
    """Read a USD file.

    Args:
        path: A `.usda`, `.usdc`, `.usd` or `.usdz` file with `metersPerUnit` authored and Z up.
        duration: Length of the run [s] that the time samples must cover, instead of the authored one.

    Returns:
        Field of a `Scene` → value in internal units (µm, s, pN, mW, K), bodies, traps and obstacles in stage order.

    Raises:
        InputError: Anything in the file that cannot be accepted, in one line.
    """
    stage = open_stage(path)
    return read_stage(stage, file=str(path), duration=duration) | {"file": path}


def read_stage(stage: Usd.Stage, *, file: str, duration: float | None = None) -> dict[str, Any]:
    """Read an open stage; `file` is what errors name. See `read_file`."""
    with reading(file):
        return _read(Source(stage, file), duration)


class _Sorted:
    """The prims of a stage by what they are."""

    def __init__(self, source: Source):
        self.traps: list[Usd.Prim] = []
        self.bodies: list[Usd.Prim] = []
        self.obstacles: list[Usd.Prim] = []
        self.single: dict[str, list[Usd.Prim]] = {"OtFlowAPI": [], "OtCameraAPI": [], "OtGoalAPI": []}
        every = list(Usd.PrimRange(source.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
        prototypes = _prototypes(every)
        for prim in every:
            check_prim(source.file, prim, source.applied(prim))
            source.values.check(prim)
            if prim.IsA(UsdGeom.Camera):
                check_lens(source.values, prim)
            if not any(prim.GetPath().HasPrefix(path) for path in prototypes):
                self._put(source, prim)

    def _put(self, source: Source, prim: Usd.Prim) -> None:
        applied = source.applied(prim)
        body = _enclosing(source, prim)
        if "OtSceneAPI" in applied and prim != source.stage.GetDefaultPrim():
            raise source.bad(prim, "apiSchemas", "OtSceneAPI", "on the default prim")
        for schema in _ELEMENTS:
            if schema in applied and (body is None or not source.has(body, "OtBodyAPI")):
                raise source.bad(prim, "apiSchemas", schema, "below a prim with OtBodyAPI")
        for schema, prims in self.single.items():
            if schema in applied:
                prims.append(prim)
        if "OtTrapAPI" in applied:
            self.traps.append(prim)
        if any(schema in applied for schema in _BODIES) or prim.IsA(UsdGeom.PointInstancer):
            if body is not None:
                raise source.bad(prim, "apiSchemas", prim.GetName(), f"outside the body {body.GetPath()}")
            self.bodies.append(prim)
        elif is_collider(source, prim) and body is None and "OtSphereAPI" not in applied:
            self.obstacles.append(prim)
        elif "OtObstacleAPI" in applied and (body is not None or not source.has(prim, "PhysicsCollisionAPI")):
            allowed = "on an obstacle: a prim with PhysicsCollisionAPI outside any body"
            raise source.bad(prim, "apiSchemas", "OtObstacleAPI", allowed)


def _prototypes(prims: list[Usd.Prim]) -> list[Sdf.Path]:
    instancers = [UsdGeom.PointInstancer(prim) for prim in prims if prim.IsA(UsdGeom.PointInstancer)]
    return [path for instancer in instancers for path in instancer.GetPrototypesRel().GetForwardedTargets()]


def _enclosing(source: Source, prim: Usd.Prim) -> Usd.Prim | None:
    parent = prim.GetParent()
    while parent and not parent.IsPseudoRoot():
        if any(source.has(parent, schema) for schema in _BODIES):
            return parent
        parent = parent.GetParent()
    return None


def _read(source: Source, duration: float | None) -> dict[str, Any]:
    root = source.stage.GetDefaultPrim()
    found = _Sorted(source)
    medium = read_medium(source, root)
    settings = read_settings(source, root, duration)
    bodies: list[Body] = []
    for prim in found.bodies:
        if prim.IsA(UsdGeom.PointInstancer):
            bodies += read_instances(source, prim)
        else:
            bodies.append(read_robot(source, prim) if source.has(prim, "OtBodyAPI") else read_cell(source, prim))
    traps = [read_trap(source, prim, settings.duration) for prim in found.traps]
    obstacles: list[Obstacle] = [read_obstacle(source, prim) for prim in found.obstacles]
    fields: dict[str, Any] = dict(
        root=str(root.GetPath()),
        medium=medium,
        settings=settings,
        traps=tuple(traps),
        bodies=tuple(bodies),
        obstacles=tuple(obstacles),
        flow=read_flow(source, found.single["OtFlowAPI"]),
        camera=read_camera(source, found.single["OtCameraAPI"]),
        goal=read_goal(source, found.single["OtGoalAPI"]),
    )
    check_scene(source.file, **fields, overlap=OVERLAP_TOLERANCE)
    odd = remarks(source, [*found.bodies, *found.single["OtFlowAPI"], *found.single["OtGoalAPI"]])
    return fields | {"remarks": tuple(odd)}
