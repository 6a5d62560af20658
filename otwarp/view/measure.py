"""The measuring tool: where a click met the scene, and how far two such places are apart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from otwarp.scene.transforms import rotation_matrix
from otwarp.teleop.page.protocol import Drawing, PageFrame

CLOSEST = 1e-9
"""Least way along a ray that counts [µm]: a camera may stand on a face."""
PARALLEL = 1e-12
"""Determinant below which a ray runs along a triangle."""


def hit(drawing: Drawing, frame: PageFrame, origin: np.ndarray, direction: np.ndarray) -> np.ndarray | None:
    """The first place (3,) at which a ray meets something opaque or clear that is drawn [µm]; None where nothing.

    Args:
        drawing: What is drawn.
        frame: Where it is.
        origin: (3,) of the ray [µm].
        direction: (3,) of any length.
    """
    way = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    start = np.asarray(origin, dtype=float)
    found = [t for t in (*_meshes(drawing, frame, start, way), *_balls(drawing, frame, start, way)) if np.isfinite(t)]
    return start + min(found) * way if found else None


def on_plane(point: np.ndarray, origin: np.ndarray, direction: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Where a ray meets the plane through a point [µm]; the foot of the point on the ray where they do not meet.

    Args:
        point: (3,) of the plane.
        origin, direction: Of the ray.
        normal: (3,) of the plane.
    """
    way = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    slope = float(np.dot(way, normal))
    toward = np.asarray(point, dtype=float) - origin
    t = float(np.dot(toward, normal)) / slope if abs(slope) > PARALLEL else float(np.dot(toward, way))
    return np.asarray(origin, dtype=float) + max(t, 0.0) * way


def _meshes(drawing: Drawing, frame: PageFrame, origin: np.ndarray, way: np.ndarray) -> Iterator[float]:
    for part in drawing.fixed:
        yield ray_triangles(part.vertices, part.faces, origin, way)
    posed: list[tuple[Iterable, np.ndarray, np.ndarray]] = [
        (body.parts, frame.position[body.index], frame.orientation[body.index]) for body in drawing.bodies
    ]
    posed += [(moving.parts, *moving.at(frame.time)) for moving in drawing.moving]
    for parts, place, turn in posed:
        if not (np.isfinite(place).all() and np.isfinite(turn).all()):
            continue
        matrix = rotation_matrix(np.asarray(turn, dtype=float))
        for part in parts:
            yield ray_triangles(part.vertices, part.faces, (origin - place) @ matrix, way @ matrix)


def _balls(drawing: Drawing, frame: PageFrame, origin: np.ndarray, way: np.ndarray) -> Iterator[float]:
    for group in drawing.balls:
        yield ray_spheres(frame.position[group.bodies], group.radii, origin, way)


def ray_triangles(points: np.ndarray, faces: np.ndarray, origin: np.ndarray, way: np.ndarray) -> float:
    """Way along a ray to the nearest of some triangles, inf for none (Möller and Trumbore 1997).

    Args:
        points: (n, 3).
        faces: (m, 3) indices.
        origin, way: (3,) of the ray; `way` has length 1.
    """
    a, b, c = (np.asarray(points, dtype=float)[faces[:, k]] for k in range(3))
    one, two = b - a, c - a
    normal = np.cross(np.broadcast_to(way, two.shape), two)
    size = np.einsum("ij,ij->i", one, normal)
    safe = np.where(np.abs(size) > PARALLEL, size, np.inf)
    out = origin - a
    u = np.einsum("ij,ij->i", out, normal) / safe
    across = np.cross(out, one)
    v = across @ way / safe
    t = np.einsum("ij,ij->i", two, across) / safe
    good = np.isfinite(safe) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > CLOSEST)
    return float(t[good].min(initial=np.inf))


def ray_spheres(centres: np.ndarray, radii: np.ndarray, origin: np.ndarray, way: np.ndarray) -> float:
    """Way along a ray to the nearest of some spheres, inf for none; arguments as of `ray_triangles`."""
    out = origin - np.asarray(centres, dtype=float)
    middle = out @ way
    inside = middle**2 - np.einsum("ij,ij->i", out, out) + np.asarray(radii, dtype=float) ** 2
    root = np.sqrt(np.maximum(inside, 0.0))
    near = -middle - root
    t = np.where(near > CLOSEST, near, -middle + root)
    return float(t[(inside >= 0.0) & (t > CLOSEST)].min(initial=np.inf))
