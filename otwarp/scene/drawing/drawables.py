"""Read what is visible in a USD stage at one time code: geometry, camera and lights, in µm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom

from otwarp.errors import InputError
from otwarp.scene.drawing.draw_list import PLANE, Drawables, Lights, TriangleMesh, View, bounds
from otwarp.scene.drawing.shapes import Batch, ShapeReader, column_matrix
from otwarp.scene.drawing.view import automatic_view, find_camera, is_light, light_matrix, read_lights, read_view
from otwarp.scene.read.attributes import applied_schemas
from otwarp.scene.read.source import open_stage

__all__ = ["Drawables", "Lights", "TriangleMesh", "View", "read_drawables"]

_TRAP = "OtTrapAPI"


class _Walk:
    """One pass over a stage: collects batches in world space (stage units), lights on the way."""

    def __init__(self, time: Usd.TimeCode, purposes: tuple[str, ...]):
        self.time, self.purposes = time, purposes
        self.shapes = ShapeReader(time)
        self.cache = UsdGeom.XformCache(time)
        self.lights: list[tuple[Usd.Prim, np.ndarray]] = []

    def hidden(self, prim: Usd.Prim) -> bool:
        """Whether this prim hides itself and all below it."""
        visibility = UsdGeom.Imageable(prim).GetVisibilityAttr() if prim.IsA(UsdGeom.Imageable) else None
        return visibility is not None and visibility.Get(self.time) == UsdGeom.Tokens.invisible

    def collect(self, root: Usd.Prim, *, beam: bool) -> list[Batch]:
        """Batches at and below `root`, in the world's frame."""
        batches: list[Batch] = []
        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
        traps = [root.GetPath()] if beam else []
        for prim in prims:
            if self.hidden(prim):
                prims.PruneChildren()
                continue
            if is_light(prim):
                self.lights.append((prim, light_matrix(self.cache, prim)))
                continue
            if _TRAP in applied_schemas(prim):
                traps.append(prim.GetPath())
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                batches += self.instances(prim)
            elif prim.IsA(UsdGeom.Gprim):
                while traps and not prim.GetPath().HasPrefix(traps[-1]):
                    traps.pop()
                batches += self.geometry(prim, beam=bool(traps))
        return batches

    def geometry(self, prim: Usd.Prim, *, beam: bool) -> list[Batch]:
        """Batches of one geometry prim in the world's frame."""
        if UsdGeom.Imageable(prim).ComputePurpose() not in self.purposes:
            return []
        own = self.shapes.read(prim, beam=beam)
        if not own:
            return []
        world = column_matrix(self.cache.GetLocalToWorldTransform(prim))
        return [batch.placed(world[None], None, None) for batch in own]

    def instances(self, prim: Usd.Prim) -> list[Batch]:
        """Batches of all instances of a PointInstancer in the world's frame."""
        instancer = UsdGeom.PointInstancer(prim)
        if UsdGeom.Imageable(prim).ComputePurpose() not in self.purposes:
            return []
        indices = np.asarray(instancer.GetProtoIndicesAttr().Get(self.time) or [], dtype=int)
        flags = UsdGeom.PointInstancer
        matrices = instancer.ComputeInstanceTransformsAtTime(
            self.time, self.time, flags.IncludeProtoXform, flags.IgnoreMask
        )
        if len(indices) == 0 or len(matrices) != len(indices):
            return []
        mask = np.asarray(instancer.ComputeMaskAtTime(self.time) or np.ones(len(indices)), dtype=bool)
        world = column_matrix(self.cache.GetLocalToWorldTransform(prim))
        placed = world @ np.asarray(matrices, dtype=float).transpose(0, 2, 1)
        colour, opacity = self.shapes.looks.per_instance(prim, np.ones(len(indices), dtype=bool))
        batches: list[Batch] = []
        for index, path in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            prototype = prim.GetStage().GetPrimAtPath(path)
            keep = mask & (indices == index)
            if not prototype or not keep.any():
                continue
            # Prototypes carry their own transform in the instance matrices; take it out of theirs.
            inverse = np.linalg.inv(column_matrix(self.cache.GetLocalToWorldTransform(prototype)))
            for batch in self.collect(prototype, beam=False):
                local = batch.placed(inverse[None], None, None)
                batches.append(
                    local.placed(
                        placed[keep],
                        None if colour is None else colour[keep],
                        None if opacity is None else opacity[keep],
                    )
                )
        return batches


def _assemble(batches: list[Batch], scale: float) -> dict[str, np.ndarray]:
    counts = [len(batch.transform) for batch in batches]
    transform = np.concatenate([batch.transform for batch in batches] or [np.zeros((0, 4, 4))])
    transform[:, :3] *= scale
    kind = np.repeat(np.array([b.kind for b in batches], dtype=np.int32), counts)
    size = np.repeat(np.array([b.size for b in batches], dtype=float).reshape(-1, 2), counts, axis=0)
    # A plane keeps its size in µm, so that the grid on it can be measured: move the scale out of its transform.
    plane = kind == PLANE
    length = np.linalg.norm(transform[plane, :3, :3], axis=1)
    size[plane] *= length[:, :2]
    transform[plane, :3, :3] /= length[:, None, :]

    def spread(name: str, width: tuple[int, ...]) -> np.ndarray:
        values = [np.broadcast_to(getattr(b.look, name), (n, *width)) for b, n in zip(batches, counts, strict=True)]
        return np.concatenate(values or [np.zeros((0, *width))])

    # A solid squashed flat or turned into a point has no inside: nothing to draw.
    solid = np.abs(np.linalg.det(transform[:, :3, :3])) > 1e-18
    arrays = {
        "kind": kind,
        "transform": transform,
        "size": size,
        "colour": spread("colour", (3,)),
        "opacity": spread("opacity", ()),
        "roughness": spread("roughness", ()),
        "beam": np.repeat(np.array([b.beam for b in batches], dtype=bool), counts),
        "mesh": np.repeat(np.array([b.mesh for b in batches], dtype=np.int32), counts),
    }
    return {name: values[solid & np.isfinite(transform).all(axis=(1, 2))] for name, values in arrays.items()}


def read_drawables(
    stage_or_path: Usd.Stage | str | Path,
    time_code: float | None = None,
    *,
    camera: str | None = None,
    purposes: tuple[str, ...] = ("default", "render"),
) -> Drawables:
    """Read everything visible at `time_code`.

    Args:
        stage_or_path: An open stage, or its file.
        time_code: Time code; None reads default values and, where there are none, the first sample.
        camera: Path or name of the camera; without it the stage's first camera, or one that frames the scene.
        purposes: UsdGeom purposes drawn; add `guide` for helpers such as force arrows.

    Returns:
        Arrays in µm, whatever the stage's `metersPerUnit`.

    Raises:
        InputError: The file is missing, not USD or not whole, `metersPerUnit` is not positive, the camera is
            unknown or has no field of view.
    """
    stage = stage_or_path if isinstance(stage_or_path, Usd.Stage) else open_stage(Path(stage_or_path))
    file = stage.GetRootLayer().GetDisplayName()
    metres = UsdGeom.GetStageMetersPerUnit(stage)
    if not metres > 0.0:
        raise InputError(f"{file}: metersPerUnit = {metres:g}, allowed (0, inf)")
    scale = metres * 1e6
    time = Usd.TimeCode.EarliestTime() if time_code is None else Usd.TimeCode(time_code)
    walk = _Walk(time, purposes)
    arrays = _assemble(walk.collect(stage.GetPseudoRoot(), beam=False), scale)
    up = np.array([0.0, 1.0, 0.0] if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y else [0.0, 0.0, 1.0])

    meshes = tuple(walk.shapes.meshes)
    lower, upper = bounds(arrays["kind"], arrays["transform"], arrays["size"], arrays["mesh"], meshes)
    # Frame the things, not the light or the ground; those only where there is nothing else.
    finite = np.isfinite(lower).all(axis=1)
    things = finite & ~arrays["beam"] & (arrays["kind"] != PLANE)
    framed = things if things.any() else finite
    if not framed.any():
        lower, upper, framed = np.full((1, 3), -10.0), np.full((1, 3), 10.0), np.ones(1, dtype=bool)
    centre = 0.5 * (lower[framed].min(axis=0) + upper[framed].max(axis=0))
    prim = find_camera(stage, camera, file)
    if prim is None:
        view = automatic_view(lower[framed], upper[framed], up)
    else:
        to_world = column_matrix(walk.cache.GetLocalToWorldTransform(prim))
        view = read_view(prim, to_world, scale, centre, time)
    return Drawables(
        **arrays,
        meshes=meshes,
        view=view,
        lights=read_lights(walk.lights, scale, centre, time),
        up=up,
        time=0.0 if time_code is None else time_code / stage.GetTimeCodesPerSecond(),
    )
