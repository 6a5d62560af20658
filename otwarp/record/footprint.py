"""Outlines of obstacles seen from above, for figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.scene.transforms import rotate

CIRCLE = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]


def surface_points(obstacle: dict[str, Any]) -> np.ndarray:
    """(n, 3) points in the obstacle's frame whose convex hull is the obstacle (its vertices, for a mesh) [µm]."""
    size, shape = np.array(obstacle["size"]), obstacle["shape"]
    if shape == "box":
        return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
    if shape == "sphere" or SHAPES[shape].round:
        ring = size[0] * np.stack([np.cos(CIRCLE), np.sin(CIRCLE), np.zeros(len(CIRCLE))], axis=1)
        half, top = 0.0 if shape == "sphere" else size[1], SHAPES[shape].top
        if top is not None:
            return np.concatenate([k * ring + [0.0, 0.0, z] for k, z in ((1.0, -half), (top, half))])
        # round ends: circles of latitude
        tilt = np.linspace(0.0, 0.5 * np.pi, 7)
        ends = [(s * (half + size[0] * np.sin(a)), a) for a in tilt for s in (-1.0, 1.0)]
        return np.concatenate([ring * np.cos(a) + [0.0, 0.0, z] for z, a in ends])
    return np.array(obstacle.get("vertices", [])).reshape(-1, 3)


def pose(obstacle: dict[str, Any], time: float) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and quaternion (4,) at `time` [s], interpolated between the samples."""
    out = []
    for name in ("position", "orientation"):
        values = np.array(obstacle[name]["values"])
        out.append(np.array([np.interp(time, obstacle[name]["times"], column) for column in values.T]))
    return out[0], out[1] / np.linalg.norm(out[1])


def outlines(obstacle: dict[str, Any], time: float, low: float, high: float) -> list[np.ndarray]:
    """Polygons (n, 2) that an obstacle covers in the x–y plane between two heights.

    Args:
        obstacle: Entry of `layout["obstacles"]` of a run's netCDF file.
        time: When [s].
        low, high: Obstacles that end below `low` or begin above `high` [µm] cover nothing.

    Returns:
        One convex polygon, or one triangle per face of a mesh; none for a plane.
    """
    place, turn = pose(obstacle, time)
    points = surface_points(obstacle)
    if not len(points):
        return []
    points = rotate(turn, points) + place
    if points[:, 2].max() < low or points[:, 2].min() > high:
        return []
    if obstacle["shape"] != "mesh":
        return [hull(points[:, :2])]
    faces = points[np.array(obstacle["triangles"], dtype=int)]
    between = (faces[:, :, 2].max(axis=1) >= low) & (faces[:, :, 2].min(axis=1) <= high)
    return list(faces[between][:, :, :2])


def hull(points: np.ndarray) -> np.ndarray:
    """Convex hull of points (n, 2), counter-clockwise.

    Source: A. M. Andrew, Information Processing Letters 9, 216 (1979), doi:10.1016/0020-0190(79)90072-3.
    """
    order = np.unique(points, axis=0)
    if len(order) < 3:
        return order
    half: list[list[np.ndarray]] = [[], []]
    for chain, rows in zip(half, (order, order[::-1]), strict=True):
        for p in rows:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 0.0:
                chain.pop()
            chain.append(p)
    return np.array(half[0][:-1] + half[1][:-1])


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
