"""One pass over what a stage shows: batches of solids in the world's frame, and the lights and the view of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import Usd, UsdGeom, UsdLux

from otwarp.scene.drawing.draw_list import PLANE, View
from otwarp.scene.drawing.shapes import Batch, ShapeReader, column_matrix
from otwarp.scene.drawing.view import automatic_view, find_camera, read_view
from otwarp.scene.read.attributes import applied_schemas
from otwarp.scene.read.bodies import instance_matrices, shown_instances
from otwarp.scene.read.typed import Values

_TRAP = "OtTrapAPI"


class Walk:
    """A pass over a stage at one time.

    Attributes:
        stage, time: What is read, and when.
        scale: µm per stage unit.
        purposes: UsdGeom purposes that are drawn.
        values: Reads attributes at that time.
        shapes: Reader of geometry, with the meshes that it has met.
        lights: Lights met so far, with their (4, 4) transforms in stage units.
    """

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode, purposes: tuple[str, ...] = ("default", "render")):
        self.stage, self.time, self.purposes = stage, time, purposes
        self.scale = UsdGeom.GetStageMetersPerUnit(stage) * 1e6
        self.values = Values(stage.GetRootLayer().GetDisplayName(), time)
        self.shapes = ShapeReader(self.values)
        self.lights: list[tuple[Usd.Prim, np.ndarray]] = []
        self._cache = UsdGeom.XformCache(time)

    def to_world(self, prim: Usd.Prim) -> np.ndarray:
        """(4, 4) transform of a prim in stage units, for column vectors."""
        return column_matrix(self._cache.GetLocalToWorldTransform(prim))

    def visible(self, root: Usd.Prim) -> Iterator[Usd.Prim]:
        """The prims at and below `root` that are not hidden; lights are put aside, instancers not entered."""
        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
        for prim in prims:
            self.values.check(prim)
            if prim.IsA(UsdGeom.Imageable) and self.values.value(prim, "visibility") == UsdGeom.Tokens.invisible:
                prims.PruneChildren()
            elif prim.HasAPI(UsdLux.LightAPI):
                self.lights.append((prim, self.to_world(prim)))
            else:
                if prim.IsA(UsdGeom.PointInstancer):
                    prims.PruneChildren()
                yield prim

    def collect(self, root: Usd.Prim) -> list[Batch]:
        """Batches at and below `root`; what is drawn below a trap is light."""
        batches: list[Batch] = []
        traps = []
        for prim in self.visible(root):
            if _TRAP in applied_schemas(prim):
                traps.append(prim.GetPath())
            while traps and not prim.GetPath().HasPrefix(traps[-1]):
                traps.pop()
            batches += self.batches(prim, beam=bool(traps))
        return batches

    def batches(self, prim: Usd.Prim, *, beam: bool) -> list[Batch]:
        """Batches of one geometry prim or PointInstancer in the world's frame; empty for others."""
        gprim, instancer = prim.IsA(UsdGeom.Gprim), prim.IsA(UsdGeom.PointInstancer)
        if not (gprim or instancer) or UsdGeom.Imageable(prim).ComputePurpose() not in self.purposes:
            return []
        if instancer:
            return self._instances(prim)
        own = self.shapes.read(prim, beam=beam)
        return [batch.placed(self.to_world(prim)[None], None, None) for batch in own]

    def _instances(self, prim: Usd.Prim) -> list[Batch]:
        instancer = UsdGeom.PointInstancer(prim)
        indices = self.values.array(prim, "protoIndices", kind=int)
        if len(indices) == 0:
            return []
        mask = shown_instances(self.values, instancer, len(indices))
        placed = self.to_world(prim) @ instance_matrices(self.values, instancer, len(indices)).transpose(0, 2, 1)
        colour, opacity = self.shapes.looks.per_instance(prim, len(indices))
        batches: list[Batch] = []
        for index, path in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            prototype = prim.GetStage().GetPrimAtPath(path)
            keep = mask & (indices == index)
            if not prototype or not keep.any():
                continue
            # where prototypes stand by themselves does not matter, but they keep their own transform
            inverse = np.linalg.inv(self.to_world(prototype.GetParent()))
            looks = [None if values is None else values[keep] for values in (colour, opacity)]
            for batch in self.collect(prototype):
                batches.append(batch.placed(inverse[None], None, None).placed(placed[keep], *looks))
        return batches

    def in_micrometres(self, batch: Batch) -> tuple[np.ndarray, np.ndarray]:
        """Transforms (k, 4, 4) and sizes (k, 2) of a batch in µm.

        A plane keeps its size in µm, so that the grid on it can be measured: the scale moves out of its transform.
        """
        transform = batch.transform * np.array([self.scale, self.scale, self.scale, 1.0])[:, None]
        size = np.tile(np.array(batch.size, dtype=float), (len(transform), 1))
        if batch.kind == PLANE:
            length = np.linalg.norm(transform[:, :3, :3], axis=1)
            size *= length[:, :2]
            transform[:, :3, :3] /= length[:, None, :]
        return transform, size

    @property
    def up(self) -> np.ndarray:
        """(3,) up direction of the stage."""
        return np.array([0.0, 1.0, 0.0] if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.y else [0.0, 0.0, 1.0])

    def view(self, camera: str | None, lower: np.ndarray, upper: np.ndarray) -> View:
        """The view of a camera, by default the stage's first; without one, a view that frames boxes (n, 3) [µm].

        Raises:
            InputError: No camera of that name, or one without a field of view.
        """
        prim = find_camera(self.stage, camera, self.stage.GetRootLayer().GetDisplayName())
        if prim is None:
            return automatic_view(lower, upper, self.up)
        return read_view(prim, self.to_world(prim), self.scale, middle(lower, upper), self.values)


def middle(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """(3,) centre of the box around boxes (n, 3)."""
    return 0.5 * (lower.min(axis=0) + upper.max(axis=0))
