"""Shapes of obstacles outside the kernels: the prim that holds each, its distance, and how it is drawn.

`SHAPES` has a row for each shape; reading, writing, overlaps, gaps of ROS, outlines and the page follow it. What a step
does with a shape stands under the same name in `otwarp.kernels.contact.obstacles.SHAPES`. Sizes are as in `Obstacle`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Distance = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""`(points (n, 3) in the shape's frame, size (3,)) → (n,)` distances from the surface, negative inside [µm]."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A row of `SHAPES`.

    Attributes:
        usd: Type of its prim.
        distance: Exact everywhere; None for a mesh, whose surface is searched.
        round: Whether it is a solid about an axis, of size (radius, half height, 0): read from and written to the
            attributes `radius`, `height` and `axis` of its prim.
        top: Of a round solid with flat ends, the radius of the upper over that of the lower end.
    """

    usd: str
    distance: Distance | None
    round: bool = False
    top: float | None = None


def outside(beyond: np.ndarray) -> np.ndarray:
    """Distance (n,) from how far points (n, k) are beyond each of k pairs of faces; negative: within."""
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


def plane_distance(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(n,) signed distances [µm] of (n, 3) points from the half space z < 0."""
    return points[:, 2]


def box_distance(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(n,) signed distances [µm] of (n, 3) points from a box of half extents `size`."""
    return outside(np.abs(points) - size)


def sphere_distance(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(n,) signed distances [µm] of (n, 3) points from a sphere of radius size[0]."""
    return np.linalg.norm(points, axis=1) - size[0]


def cylinder_distance(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(n,) signed distances [µm] of (n, 3) points from a cylinder of radius size[0] and half height size[1]."""
    across = np.hypot(points[:, 0], points[:, 1]) - size[0]
    return outside(np.stack([across, np.abs(points[:, 2]) - size[1]], axis=1))


def capsule_distance(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Radius size[0], half height of the straight part size[1]."""
    along = np.clip(points[:, 2], -size[1], size[1])
    return np.linalg.norm(points - along[:, None] * np.array([0.0, 0.0, 1.0]), axis=1) - size[0]


SHAPES: dict[str, Shape] = {
    "plane": Shape(usd="Plane", distance=plane_distance),
    "box": Shape(usd="Cube", distance=box_distance),
    "sphere": Shape(usd="Sphere", distance=sphere_distance),
    "cylinder": Shape(usd="Cylinder", distance=cylinder_distance, round=True, top=1.0),
    "capsule": Shape(usd="Capsule", distance=capsule_distance, round=True),
    "mesh": Shape(usd="Mesh", distance=None),
}
"""Shapes by the names of `Obstacle.shape`."""

ROUND = {shape.usd: name for name, shape in SHAPES.items() if shape.round}
"""Names of the round solids by the types of their prims."""
