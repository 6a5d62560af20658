"""Triangle meshes: polygons cut into triangles, distance of points, whether they are inside, whether it is closed.

Every test first asks for bounding boxes, all points against all triangles at once, so that ten thousand cells in a
mesh of some thousand triangles take less than a second; the exact formulas then see the few pairs that are left.
"""

from __future__ import annotations

import numpy as np

from otwarp.scene.transforms import rotate

PAIRS = 2**22
"""Points × triangles that are compared at once: some ten megabytes."""

_TILT = np.array([0.1907, 0.3315, -0.4127, 0.8264])
"""Rotation before rays are cast along +Z, so that none meets an edge of a mesh that is aligned with the axes."""

_WELD = 1e-6
"""Vertices this close, relative to the mesh, are one."""


def fan(counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Triangles (m, 3) of polygons given by their corner counts and concatenated corner indices, as fans."""
    many = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, many)
    step = np.arange(len(first)) - np.repeat(np.cumsum(many) - many, many)
    return np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)


def nearest_distance(points: np.ndarray, reach: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unsigned distance (n,) of points (n, 3) from a mesh, inf beyond `reach` (n,)."""
    corners = vertices[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    out = np.full(len(points), np.inf)
    for rows in _blocks(len(points), len(corners)):
        p, r = points[rows, None, :], reach[rows, None]
        near = np.ones((len(p), len(corners)), dtype=bool)
        for axis in range(3):
            near &= (p[..., axis] >= low[:, axis] - r) & (p[..., axis] <= high[:, axis] + r)
        which, face = np.nonzero(near)
        np.minimum.at(out, rows[which], triangle_distance(points[rows[which]], corners[face]))
    return np.where(out <= reach, out, np.inf)


def triangle_distance(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance (n,) of points (n, 3) from triangles (n, 3, 3): to the plane above the inside, else to an edge."""
    edges = np.roll(corners, -1, axis=1) - corners
    ways = points[:, None, :] - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    size = np.linalg.norm(normal, axis=1)
    normal /= np.where(size > 0.0, size, 1.0)[:, None]
    inside = (np.einsum("nki,ni->nk", np.cross(edges, ways), normal) >= 0.0).all(axis=1) & (size > 0.0)
    length = np.maximum((edges**2).sum(axis=2), np.finfo(float).tiny)
    along = ((ways * edges).sum(axis=2) / length).clip(0.0, 1.0)
    edge = np.linalg.norm(ways - along[..., None] * edges, axis=2).min(axis=1)
    return np.where(inside, np.abs((ways[:, 0] * normal).sum(axis=1)), edge)


def inside_mesh(points: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Which points (n,) lie inside a mesh: faces crossed by a ray, those facing along it less those facing against.

    A mesh that is not closed has no inside: none. One whose faces look inwards encloses free space: none either.
    """
    if not is_closed(vertices, triangles):
        return np.zeros(len(points), dtype=bool)
    tilt = _TILT / np.linalg.norm(_TILT)
    corners, points = rotate(tilt, vertices)[triangles], rotate(tilt, points)
    low, high = corners.min(axis=1), corners.max(axis=1)
    crossings = np.zeros(len(points))
    for rows in _blocks(len(points), len(corners)):
        p = points[rows, None, :]
        above = p[..., 2] <= high[:, 2]
        for axis in range(2):
            above &= (p[..., axis] >= low[:, axis]) & (p[..., axis] <= high[:, axis])
        which, face = np.nonzero(above)
        np.add.at(crossings, rows[which], _crossing(points[rows[which]], corners[face]))
    return crossings > 0.5


def _crossing(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(n,) 1 where the ray from a point along +Z leaves through its triangle, −1 where it enters, 0 where it misses."""
    ways = corners - points[:, None, :]
    after = np.roll(ways, -1, axis=1)
    areas = ways[..., 0] * after[..., 1] - ways[..., 1] * after[..., 0]
    total = areas.sum(axis=1)
    hit = ((areas > 0.0).all(axis=1) | (areas < 0.0).all(axis=1)) & (total != 0.0)
    # height of the hit by barycentric coordinates: the weight of corner k is the area over the edge k + 1, k + 2
    weights = np.roll(areas, -1, axis=1) / np.where(total != 0.0, total, 1.0)[:, None]
    above = (weights * ways[..., 2]).sum(axis=1) > 0.0
    return np.where(hit & above, np.sign(total), 0.0)


def is_closed(vertices: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether every edge is met once in each direction, vertices at the same place counting as one."""
    size = float(np.ptp(vertices, axis=0).max()) or 1.0
    _, welded = np.unique(np.round(vertices / (_WELD * size)).astype(np.int64), axis=0, return_inverse=True)
    faces = welded.reshape(-1)[triangles]
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    edges = edges[edges[:, 0] != edges[:, 1]]
    forth, back = edges[np.lexsort(edges.T)], edges[:, ::-1][np.lexsort(edges[:, ::-1].T)]
    return np.array_equal(forth, back)


def _blocks(points: int, triangles: int) -> list[np.ndarray]:
    return np.array_split(np.arange(points), max(1, -(-points * triangles // PAIRS)))
