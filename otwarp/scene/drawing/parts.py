"""What is drawn of a stage at its start, by the prim that it belongs to: for viewers that move bodies themselves.

Knows USD; what it gives is plain NumPy in µm, of the kinds of `otwarp.scene.drawing.draw_list`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd

from otwarp.scene.appearance.missing import with_missing_looks
from otwarp.scene.drawing.draw_list import EMPTY, PLANE, TriangleMesh, View, bounds
from otwarp.scene.drawing.shapes import Batch
from otwarp.scene.drawing.walk import Walk
from otwarp.scene.read.diagnostics import reading
from otwarp.scene.read.variations import Variations

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

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """(k, 3) lower and (k, 3) upper corners of the boxes of the copies [µm]."""
        many, meshes = len(self.transform), (self.mesh,) if self.mesh else ()
        sizes, index = np.tile(self.size, (many, 1)), np.full(many, len(meshes) - 1)
        return bounds(np.full(many, self.kind), self.transform, sizes, index, meshes)


def read_drawn(
    file: Path, owners: Iterable[str], lights: Iterable[str], overrides: Mapping[str, Any] | None = None
) -> tuple[dict[str, list[Drawn]], View]:
    """Everything visible at the start, by owner, and the camera through which it is meant to be seen.

    Args:
        file: USD stage.
        owners: Prim paths; what is drawn at or below one belongs to it, all else to `REST`.
        lights: Those of them that are traps: what they draw is light, with its emissive colour.
        overrides: Attributes that have other values than in the file, as `Scene.overrides` has them.

    Returns:
        Owner → what is drawn of it, in world coordinates; and the view of the stage's first camera, or one that frames
        what is not light or plane.

    Raises:
        InputError: The file is missing or not a stage, or its camera has no field of view.
    """
    stage = with_missing_looks(Variations(file).varied(overrides or {}))
    with reading(str(file)):
        return _read_drawn(stage, owners, lights)


def _read_drawn(stage: Usd.Stage, owners: Iterable[str], lights: Iterable[str]) -> tuple[dict[str, list[Drawn]], View]:
    walk = Walk(stage, Usd.TimeCode.EarliestTime())
    known, traps = {Sdf.Path(path) for path in owners}, {Sdf.Path(path) for path in lights}
    found: dict[str, list[Drawn]] = {}
    things = []
    for prim in walk.visible(stage.GetPseudoRoot()):
        owner = _owner(prim.GetPath(), known)
        beam = bool(owner) and Sdf.Path(owner) in traps
        drawn = [_drawn(walk, batch) for batch in walk.batches(prim, beam=beam)]
        if drawn:
            found.setdefault(owner, []).extend(drawn)
            things += [] if beam else [d.bounds() for d in drawn if d.kind != PLANE]
    lower, upper = (np.concatenate(corners) for corners in zip(*things or [EMPTY], strict=True))
    return found, walk.view(None, lower, upper)


def _owner(path: Sdf.Path, known: set[Sdf.Path]) -> str:
    while path != Sdf.Path.absoluteRootPath and not path.isEmpty:
        if path in known:
            return str(path)
        path = path.GetParentPath()
    return REST


def _drawn(walk: Walk, batch: Batch) -> Drawn:
    many = len(batch.transform)
    transform, size = walk.in_micrometres(batch)
    return Drawn(
        kind=batch.kind,
        transform=transform,
        size=(float(size[0, 0]), float(size[0, 1])),
        colour=np.broadcast_to(batch.look.colour, (many, 3)),
        opacity=np.broadcast_to(batch.look.opacity, (many,)),
        mesh=walk.shapes.meshes[batch.mesh] if batch.mesh >= 0 else None,
    )
