"""USD geometry → batches of canonical solids (see `draw_list`)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics

from otwarp.scene.drawing.draw_list import BOX, CAPSULE, MESH, PLANE, SPHERE, TUBE, TriangleMesh
from otwarp.scene.drawing.looks import Look, Looks
from otwarp.scene.meshes import fan
from otwarp.scene.read.typed import Values

_AXES = {"Z": [0, 1, 2], "X": [1, 2, 0], "Y": [2, 0, 1]}
SMOOTHING_ANGLE = np.cos(np.radians(50.0))
"""Cosine of the largest angle between a facet and the mean normal at its corner that still reads as smooth."""


@dataclass(frozen=True)
class Batch:
    """k copies of one solid: transforms (k, 4, 4) for column vectors, colour (k or 1, 3), opacity (k or 1,)."""

    kind: int
    transform: np.ndarray
    look: Look
    size: tuple[float, float] = (0.0, 0.0)
    beam: bool = False
    mesh: int = -1

    def placed(self, matrices: np.ndarray, colour: np.ndarray | None, opacity: np.ndarray | None) -> Batch:
        """Copies at each of the (m, 4, 4) `matrices`, with per-copy colours where given: m·k solids."""
        many, own = len(matrices), len(self.transform)
        transform = np.einsum("mij,kjl->mkil", matrices, self.transform).reshape(-1, 4, 4)
        old = np.broadcast_to(self.look.colour, (own, 3)), np.broadcast_to(self.look.opacity, (own,))
        look = Look(
            np.tile(old[0], (many, 1)) if colour is None else np.repeat(colour, own, axis=0),
            np.tile(old[1], many) if opacity is None else np.repeat(opacity, own, axis=0),
            self.look.roughness,
        )
        return dataclasses.replace(self, transform=transform, look=look)


def column_matrix(matrix: object) -> np.ndarray:
    """A `Gf.Matrix4d` (row vectors) as a (4, 4) array for column vectors."""
    return np.array(matrix, dtype=float).T


def _scaled(axis: str, x: float, y: float, z: float, offset: float = 0.0) -> np.ndarray:
    """Scale the canonical axes, move along the axis, then turn z onto the USD `axis`."""
    matrix = np.zeros((4, 4))
    order = _AXES[axis]
    for column, (row, scale) in enumerate(zip(order, (x, y, z), strict=True)):
        matrix[row, column] = scale
    matrix[order[2], 3], matrix[3, 3] = offset, 1.0
    return matrix


def _capsule(prim: Usd.Prim, axis: str, values: Values) -> list[tuple[int, np.ndarray, tuple[float, float]]]:
    half = 0.5 * values.number(prim, "height")
    names = ("radius", "radius") if prim.IsA(UsdGeom.Capsule) else ("radiusBottom", "radiusTop")
    bottom, top = (values.number(prim, name) for name in names)
    if bottom == top and bottom > 0.0:
        return [(CAPSULE, _scaled(axis, bottom, bottom, bottom), (half / bottom, 0.0))]
    parts = [(SPHERE, _scaled(axis, r, r, r, z), (0.0, 0.0)) for r, z in ((bottom, -half), (top, half)) if r > 0.0]
    return parts + _tube(axis, bottom, top, half)


def _tube(axis: str, bottom: float, top: float, half: float) -> list[tuple[int, np.ndarray, tuple[float, float]]]:
    if bottom < top:  # the canonical wide end is at −z: look at it from the other side
        return [(TUBE, _scaled(axis, -top, top, -half), (bottom / top, 0.0))] if top > 0.0 else []
    return [(TUBE, _scaled(axis, bottom, bottom, half), (top / bottom, 0.0))] if bottom > 0.0 else []


def _plane(prim: Usd.Prim, axis: str, values: Values) -> list[tuple[int, np.ndarray, tuple[float, float]]]:
    # To a collision solver a plane has no edge; it is drawn so unless the author gave it a size.
    sized = any(prim.GetAttribute(name).IsAuthored() for name in ("width", "length"))
    endless = prim.HasAPI(UsdPhysics.CollisionAPI) and not sized
    if endless:
        return [(PLANE, _scaled(axis, 1.0, 1.0, 1.0), (np.inf, np.inf))]
    # UsdGeomPlane measures (width, length) along (x, y) for axis Z, (z, y) for X and (x, z) for Y.
    x, y = ("width", "length") if axis == "Z" else ("length", "width")
    size = (0.5 * values.number(prim, x), 0.5 * values.number(prim, y))
    sides = [(PLANE, _scaled(axis, 1.0, 1.0, 1.0), size)]
    # A wall of a channel is seen from the liquid only, so that one can look in from behind it.
    if not prim.HasAPI(UsdPhysics.CollisionAPI) and values.value(prim, "doubleSided"):
        sides.append((PLANE, _scaled(axis, -1.0, 1.0, -1.0), size))
    return sides


def _points(prim: Usd.Prim, values: Values) -> np.ndarray:
    """(k, 4, 4) transforms of the unit ball onto the points of a UsdGeomPoints prim."""
    centres, widths = values.array(prim, "points", 3), values.array(prim, "widths")
    widths = widths if len(widths) else np.ones(1)
    if len(widths) not in (1, len(centres)):
        raise values.bad(prim, "widths", f"{len(widths)} numbers", f"one, or as many as points, {len(centres)}")
    transform = np.zeros((len(centres), 4, 4))
    transform[:, [0, 1, 2], [0, 1, 2]] = 0.5 * np.broadcast_to(widths, len(centres))[:, None]
    transform[:, :3, 3], transform[:, 3, 3] = centres, 1.0
    return transform


def triangulated(prim: Usd.Prim, values: Values) -> TriangleMesh | None:
    """The faces of a mesh as a fan of triangles each, with smooth normals across shallow edges; None when empty."""
    points = values.array(prim, "points", 3)
    counts, indices = (values.array(prim, f"faceVertex{name}", kind=int) for name in ("Counts", "Indices"))
    if len(points) == 0 or len(indices) == 0 or counts.sum() != len(indices) or counts.min() < 0:
        return None
    if indices.min() < 0 or indices.max() >= len(points):
        return None
    triangles = fan(counts, indices)
    if values.value(prim, "orientation") == UsdGeom.Tokens.leftHanded:
        triangles = triangles[:, ::-1]
    return TriangleMesh(points=points, triangles=triangles, normals=corner_normals(points, triangles))


def corner_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m, 3, 3) normals: the mean at the vertex where the surface is smooth, else the facet's own.

    Facets count by their angle at the vertex, so that the mean does not depend on how faces were cut into triangles
    (G. Thürmer and C. A. Wüthrich, J. Graphics Tools 3, 43, 1998, doi:10.1080/10867651.1998.10487487).
    """
    corner = points[triangles]
    ahead, back = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    area = np.cross(ahead[:, 0], back[:, 0])
    facet = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)
    turn = np.linalg.norm(np.cross(ahead, back), axis=2)
    angle = np.arctan2(turn, np.einsum("mki,mki->mk", ahead, back))
    mean = np.zeros_like(points)
    np.add.at(mean, triangles.ravel(), (angle[..., None] * facet[:, None, :]).reshape(-1, 3))
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    corners = mean[triangles]
    smooth = np.einsum("mkj,mj->mk", corners, facet) > SMOOTHING_ANGLE
    return np.where(smooth[..., None], corners, facet[:, None, :])


class ShapeReader:
    """Turns geometry prims into batches in their own frame; keeps the meshes they share."""

    def __init__(self, values: Values):
        self.values = values
        self.looks = Looks(values)
        self.meshes: list[TriangleMesh] = []
        self._mesh_of: dict[str, int] = {}

    def _mesh(self, prim: Usd.Prim) -> int | None:
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        key = str(source.GetPath())
        if key not in self._mesh_of:
            triangles = triangulated(prim, self.values)
            if triangles is None:
                return None
            self._mesh_of[key] = len(self.meshes)
            self.meshes.append(triangles)
        return self._mesh_of[key]

    def _solids(self, prim: Usd.Prim) -> list[tuple[int, np.ndarray, tuple[float, float]]]:
        values = self.values

        def get(name: str) -> float:
            return values.number(prim, name)

        axis = values.value(prim, "axis", absent="Z")
        if prim.IsA(UsdGeom.Sphere):
            r = get("radius")
            return [(SPHERE, _scaled("Z", r, r, r), (0.0, 0.0))] if r > 0.0 else []
        if prim.IsA(UsdGeom.Cube):
            half = 0.5 * get("size")
            return [(BOX, _scaled("Z", half, half, half), (0.0, 0.0))] if half > 0.0 else []
        if prim.IsA(UsdGeom.Cylinder):
            return _tube(axis, get("radius"), get("radius"), 0.5 * get("height"))
        if prim.IsA(UsdGeom.Cylinder_1):
            return _tube(axis, get("radiusBottom"), get("radiusTop"), 0.5 * get("height"))
        if prim.IsA(UsdGeom.Cone):
            return _tube(axis, get("radius"), 0.0, 0.5 * get("height"))
        if prim.IsA(UsdGeom.Capsule) or prim.IsA(UsdGeom.Capsule_1):
            return _capsule(prim, axis, values)
        return _plane(prim, axis, values) if prim.IsA(UsdGeom.Plane) else []

    def read(self, prim: Usd.Prim, *, beam: bool) -> list[Batch]:
        """The solids of one geometry prim in its own frame; empty for geometry that is not drawn."""
        if prim.IsA(UsdGeom.Mesh):
            index = self._mesh(prim)
            if index is None:
                return []
            return [Batch(MESH, np.eye(4)[None], self.looks.of(prim, beam=False), mesh=index)]
        if prim.IsA(UsdGeom.Points):
            transform = _points(prim, self.values)
            return [Batch(SPHERE, transform, self.looks.of(prim, beam=beam), beam=beam)] if len(transform) else []
        solids = self._solids(prim)
        if not solids:
            return []
        look = self.looks.of(prim, beam=beam)
        glows = [beam and kind in (SPHERE, TUBE) for kind, _, _ in solids]
        return [
            Batch(kind, matrix[None], look, size, beam=glow)
            for (kind, matrix, size), glow in zip(solids, glows, strict=True)
        ]
