"""A closed triangle mesh as a solid: which points are inside, how deep, and how full the cells of a grid are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.hydrodynamics.mesh_surface import sample_mesh
from otwarp.triangles import check_mesh_size, read_triangles

MOST_CELLS = 20_000_000
"""Cells of the box around a mesh; one that needs more is too thin or too sparse for balls anyway."""

NUDGE = (1.3e-5, 2.7e-5)
"""Offset of the columns that count crossings, in cells, so that none runs through an authored edge."""


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """Vertices (v, 3) [µm], triangles (t, 3) anticlockwise from outside, and the volume that they enclose [µm³]."""

    vertices: np.ndarray
    triangles: np.ndarray
    volume: float


@dataclass(frozen=True, eq=False)
class Solid:
    """Cells of a cubic grid around a mesh.

    Attributes:
        cell: Edge of a cell [µm].
        place: (k, 3) middles of the cells [µm].
        depth: (k,) distance of the middle from the surface, positive inside [µm].
        fill: (k,) part of the cell that is inside.
    """

    cell: float
    place: np.ndarray
    depth: np.ndarray
    fill: np.ndarray


def closed_mesh(mesh: Any, metres_per_unit: float = 1e-6) -> ClosedMesh:
    """Read and check a mesh.

    Args:
        mesh: File that trimesh reads (STL, OBJ, PLY, …), a `trimesh.Trimesh`, or (vertices, triangles).
        metres_per_unit: Length of a unit of the mesh [m].

    Raises:
        InputError: No such file, the package trimesh is missing, the surface is not closed, or its size is one
            that no microscope would show.
    """
    if not (np.isfinite(metres_per_unit) and metres_per_unit > 0.0):
        raise InputError(f"argument metres_per_unit = {metres_per_unit:g}: must be in (0, inf)")
    name, mesh = read_triangles(mesh, "argument mesh", "a closed triangle mesh")
    check_mesh_size(name, float(np.ptp(mesh.vertices, axis=0).max()), metres_per_unit)
    mesh.vertices = mesh.vertices * (metres_per_unit / 1e-6)  # before corners are joined: trimesh does within 1e-8
    mesh.process(validate=False)  # joins the corners that STL keeps apart
    if not (mesh.is_watertight and mesh.is_winding_consistent):
        raise InputError(f"{name}: the surface has holes or is turned inside out in parts; allowed: a closed one")
    vertices, triangles = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
    volume = float(mesh.volume)
    if not (np.isfinite(volume) and volume != 0.0):
        raise InputError(f"{name}: encloses a volume of {volume:g}; allowed: a closed surface around a solid")
    return ClosedMesh(vertices, triangles if volume > 0.0 else triangles[:, ::-1], abs(volume))


def solid_of(mesh: ClosedMesh, cells: int) -> Solid:
    """Sort the cells of a grid.

    The distance is that to the nearest of points a third of a cell apart, and near the surface that to its plane; what
    is inside has an odd number of crossings below it.

    Args:
        mesh: The surface.
        cells: About how many cells shall be inside.

    Returns:
        The cells inside, and those no farther outside than the deepest is inside.
    """
    from scipy.spatial import KDTree

    cell = (mesh.volume / cells) ** (1.0 / 3.0)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    counts = np.ceil((high - low) / cell).astype(int) + 2
    if np.prod(counts.astype(float)) > MOST_CELLS:
        raise InputError(f"argument mesh: fills 1/{np.prod(high - low) / mesh.volume:.0f} of its box; allowed: more")
    inside, origin = _crossed(mesh, 0.5 * (low + high) - 0.5 * cell * counts, cell, counts), 0.5 * (low + high)
    corners = mesh.vertices[mesh.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    point, normal, _ = sample_mesh(mesh.vertices, mesh.triangles, int(area / (cell / 3.0) ** 2))
    tree = KDTree(point)
    deepest = float(np.max(tree.query(origin + cell * (np.argwhere(inside) + 0.5 - 0.5 * counts))[0]))
    rim = int(np.ceil(deepest / cell))
    inside, counts = np.pad(inside, rim), counts + 2 * rim
    place = origin + cell * (np.argwhere(np.ones(counts, dtype=bool)) + 0.5 - 0.5 * counts)
    distance, nearest = map(np.asarray, tree.query(place, distance_upper_bound=deepest + cell))
    near = np.isfinite(distance)
    place, distance, nearest, inside = place[near], distance[near], nearest[near], inside.ravel()[near]
    plane = np.abs(np.einsum("ki,ki->k", place - point[nearest], normal[nearest]))
    depth = np.where(distance < cell, plane, distance) * np.where(inside, 1.0, -1.0)
    return Solid(cell, place, depth, np.clip(0.5 + depth / cell, 0.0, 1.0))


def _crossed(mesh: ClosedMesh, origin: np.ndarray, cell: float, counts: np.ndarray) -> np.ndarray:
    """(nx, ny, nz) whether the middle of each cell is inside: an odd number of crossings below it."""
    corners = (mesh.vertices[mesh.triangles] - origin) / cell - 0.5  # the middle of cell (i, j, k) is at (i, j, k)
    corners[..., :2] -= NUDGE
    low = np.maximum(np.ceil(corners[..., :2].min(axis=1)).astype(int), 0)
    high = np.minimum(np.floor(corners[..., :2].max(axis=1)).astype(int), counts[:2] - 1)
    wide = np.maximum(high - low + 1, 0)
    many = wide[:, 0] * wide[:, 1]
    owner = np.repeat(np.arange(len(many)), many)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(many) - many, many)
    column = low[owner] + np.stack([step // wide[owner, 1], step % wide[owner, 1]], axis=1)
    a, b, c = (corners[owner, k] for k in range(3))

    def side(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return (q[:, 0] - p[:, 0]) * (column[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (column[:, 0] - p[:, 0])

    weight = np.stack([side(b, c), side(c, a), side(a, b)], axis=1)
    hit = (weight > 0.0).all(axis=1) | (weight < 0.0).all(axis=1)
    weight, column = weight[hit], column[hit]
    height = np.einsum("kc,kc->k", weight, corners[owner[hit], :, 2]) / weight.sum(axis=1)
    below = np.clip(np.ceil(height).astype(int), 0, counts[2])  # first cell above the crossing
    crossings = np.zeros((*counts[:2], counts[2] + 1), dtype=int)
    np.add.at(crossings, (column[:, 0], column[:, 1], below), 1)
    return np.cumsum(crossings, axis=2)[:, :, :-1] % 2 == 1
