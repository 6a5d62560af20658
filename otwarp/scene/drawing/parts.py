"""What is drawn of a stage at its start, by the prim that it belongs to: for viewers that move bodies themselves.

Knows USD; what it gives is plain NumPy in µm, of the kinds of `otwarp.scene.drawing.draw_list`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from otwarp.scene.drawing.draw_list import PLANE, TriangleMesh, View, bounds
from otwarp.scene.drawing.drawables import _Walk
from otwarp.scene.drawing.shapes import Batch, column_matrix
from otwarp.scene.drawing.view import automatic_view, find_camera, is_light, read_view
from otwarp.scene.read.source import open_stage

REST = ""
"""Owner of what belongs to none of the prims asked for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Drawn:
    """k copies of one solid.

    Attributes:
        kind: One of `SPHERE` … `MESH`.
        transform: (k, 4, 4) world = transform @ canonical solid, column vectors [µm].
        size: Parameters of the kind; those of a plane in µm.
        colour: (k, 3) linear RGB.
        opacity: (k,).
        mesh: Triangles in their own frame, for `MESH`.
    """

    kind: int
    transform: np.ndarray
    size: tuple[float, float]
    colour: np.ndarray
    opacity: np.ndarray
    mesh: TriangleMesh | None = None


def read_drawn(file: Path, owners: Iterable[str], lights: Iterable[str]) -> tuple[dict[str, list[Drawn]], View]:
    """Everything visible at the start, by owner, and the camera through which it is meant to be seen.

    Args:
        file: USD stage.
        owners: Prim paths; what is drawn at or below one belongs to it, all else to `REST`.
        lights: Those of them that are traps: what they draw is light, with its emissive colour.

    Returns:
        Owner → what is drawn of it, in world coordinates; and the view of the stage's first camera, or one that frames
        what is not light or plane.

    Raises:
        InputError: The file is missing or not a stage, or its camera has no field of view.
    """
    stage = open_stage(file)
    time = Usd.TimeCode.EarliestTime()
    scale = UsdGeom.GetStageMetersPerUnit(stage) * 1e6
    walk = _Walk(time, ("default", "render"))
    known, traps = {Sdf.Path(path) for path in owners}, {Sdf.Path(path) for path in lights}
    found: dict[str, list[Batch]] = {}
    prims = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
    for prim in prims:
        if walk.hidden(prim):
            prims.PruneChildren()
        elif is_light(prim):
            continue
        elif prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
            found.setdefault(_owner(prim.GetPath(), known), []).extend(walk.instances(prim))
        elif prim.IsA(UsdGeom.Gprim):
            owner = _owner(prim.GetPath(), known)
            beam = Sdf.Path(owner) in traps if owner else False
            found.setdefault(owner, []).extend(walk.geometry(prim, beam=beam))
    meshes = walk.shapes.meshes
    drawn = {owner: [_drawn(batch, scale, meshes) for batch in batches] for owner, batches in found.items()}
    return drawn, _view(
        stage, walk, scale, [d for o, list_ in drawn.items() if Sdf.Path(o or "/") not in traps for d in list_]
    )


def _owner(path: Sdf.Path, known: set[Sdf.Path]) -> str:
    while path != Sdf.Path.absoluteRootPath and not path.isEmpty:
        if path in known:
            return str(path)
        path = path.GetParentPath()
    return REST


def _drawn(batch: Batch, scale: float, meshes: list[TriangleMesh]) -> Drawn:
    """A batch in µm. A plane keeps its size there: the scale moves out of its transform, as in `drawables`."""
    transform, many = batch.transform.copy(), len(batch.transform)
    transform[:, :3] *= scale
    size = batch.size
    if batch.kind == PLANE:
        length = np.linalg.norm(transform[:, :3, :3], axis=1)
        size = (float(size[0] * length[0, 0]), float(size[1] * length[0, 1]))
        transform[:, :3, :3] /= length[:, None, :]
    return Drawn(
        kind=batch.kind,
        transform=transform,
        size=size,
        colour=np.broadcast_to(batch.look.colour, (many, 3)),
        opacity=np.broadcast_to(batch.look.opacity, (many,)),
        mesh=meshes[batch.mesh] if batch.mesh >= 0 else None,
    )


def _view(stage: Usd.Stage, walk: _Walk, scale: float, drawn: list[Drawn]) -> View:
    boxes = [
        bounds(
            np.full(len(d.transform), d.kind),
            d.transform,
            np.tile(d.size, (len(d.transform), 1)),
            np.full(len(d.transform), 0 if d.mesh else -1),
            (d.mesh,) if d.mesh else (),
        )
        for d in drawn
        if d.kind != PLANE
    ] or [(np.full((1, 3), -10.0), np.full((1, 3), 10.0))]
    lower, upper = (np.concatenate([box[k] for box in boxes]) for k in range(2))
    up = np.array([0.0, 1.0, 0.0] if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y else [0.0, 0.0, 1.0])
    prim = find_camera(stage, None, stage.GetRootLayer().GetDisplayName())
    if prim is None:
        return automatic_view(lower, upper, up)
    centre = 0.5 * (lower.min(axis=0) + upper.max(axis=0))
    return read_view(prim, column_matrix(walk.cache.GetLocalToWorldTransform(prim)), scale, centre, walk.time)
