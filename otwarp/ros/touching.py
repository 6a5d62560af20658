"""Distances of points from the surfaces of obstacles, to say which of them is touched."""

from __future__ import annotations

import numpy as np

from otwarp.haptics.core.types import Vec3
from otwarp.scene.description import Obstacle
from otwarp.scene.transforms import conjugate, rotate


def gap(obstacle: Obstacle, pose: tuple[Vec3, tuple[float, float, float, float]], points: np.ndarray) -> np.ndarray:
    """Signed distances of (n, 3) points from an obstacle's surface, negative inside [µm]; inf for a mesh.

    Args:
        obstacle: Its shape and size.
        pose: Where it is now.
        points: [µm].
    """
    place, turn = pose
    p = rotate(conjugate(np.array(turn)), points - np.array(place))
    size = np.array(obstacle.size)
    if obstacle.shape == "plane":
        return p[:, 2]
    if obstacle.shape == "sphere":
        return np.linalg.norm(p, axis=1) - size[0]
    if obstacle.shape == "capsule":
        along = np.clip(p[:, 2], -size[1], size[1])
        return np.linalg.norm(p - along[:, None] * np.array([0.0, 0.0, 1.0]), axis=1) - size[0]
    if obstacle.shape == "box":
        return _outside(np.abs(p) - size)
    if obstacle.shape == "cylinder":
        across = np.hypot(p[:, 0], p[:, 1]) - size[0]
        return _outside(np.stack([across, np.abs(p[:, 2]) - size[1]], axis=1))
    return np.full(len(p), np.inf)


def _outside(beyond: np.ndarray) -> np.ndarray:
    """Distance from how far a point is beyond each pair of faces (negative: within)."""
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
