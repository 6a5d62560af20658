"""The canonical solids of `otwarp.scene.drawing.draw_list` as triangles, each vertex with one normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from otwarp.scene.drawing.draw_list import BOX, CAPSULE, PLANE, SPHERE
from otwarp.scene.drawing.shapes import Batch

SIDES, RINGS = 32, 16
"""Flat sides of round things, and rings from pole to pole: a ball is up to 0.5 % of its radius too small."""

ENDLESS = 300.0
"""Half side at which a plane without edges is cut off [µm]."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles (m, 3) over vertices with (n, 3) places and unit normals."""

    points: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray

    def placed(self, matrix: np.ndarray) -> Surface:
        """The same under an affine map (4, 4) for column vectors; a mirror image keeps its outside outside."""
        linear = matrix[:3, :3]
        normals = self.normals @ np.linalg.inv(linear)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        triangles = self.triangles if np.linalg.det(linear) > 0.0 else self.triangles[:, ::-1]
        return Surface(self.points @ linear.T + matrix[:3, 3], normals, triangles)


def joined(parts: list[Surface]) -> Surface:
    """Several surfaces as one."""
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    triangles = [part.triangles + start for part, start in zip(parts, starts, strict=False)]
    return Surface(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate(triangles),
    )


def surface(batch: Batch, micrometre: float) -> Surface:
    """A batch of one kind other than `MESH`, in its own frame; `micrometre` is one in units of that frame."""
    return joined([_solid(batch, micrometre).placed(matrix) for matrix in batch.transform])


def _solid(batch: Batch, micrometre: float) -> Surface:
    if batch.kind == SPHERE:
        return _turned(*_arc(0.0, np.pi, RINGS))
    if batch.kind == BOX:
        return _box()
    if batch.kind == CAPSULE:
        top, bottom = _arc(0.0, np.pi / 2, RINGS // 2), _arc(np.pi / 2, np.pi, RINGS // 2)
        half = batch.size[0]
        profile = np.concatenate([top[0] + (0.0, half), bottom[0] - (0.0, half)])
        return _turned(profile, np.concatenate([top[1], bottom[1]]))
    if batch.kind == PLANE:
        half = np.minimum(batch.size, ENDLESS * micrometre)
        points = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * (*half, 0.0)
        return Surface(points, np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([(0, 1, 2), (0, 2, 3)]))
    return _tube(batch.size[0])


def _arc(start: float, end: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Profile (n, 2) of radius and height, and normals, of a ball between two polar angles."""
    angle = np.linspace(start, end, steps + 1)
    profile = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    return profile, profile


def _turned(profile: np.ndarray, normals: np.ndarray) -> Surface:
    """Profiles (n, 2) of radius and height from the top down, turned about z; triangles without area are left out."""
    angle = np.arange(SIDES) * 2 * np.pi / SIDES
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def around(rows: np.ndarray) -> np.ndarray:
        ring = np.broadcast_to(rows[:, None, 1:], (len(rows), SIDES, 1))
        return np.concatenate([rows[:, None, :1] * circle, ring], axis=2).reshape(-1, 3)

    first = np.arange(len(profile) - 1)[:, None] * SIDES + np.arange(SIDES)
    after = np.arange(len(profile) - 1)[:, None] * SIDES + (np.arange(SIDES) + 1) % SIDES
    a, b, c, d = (x.ravel() for x in (first, after, first + SIDES, after + SIDES))
    triangles = np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])
    points = around(profile)
    corner = points[triangles]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    return Surface(points, around(normals), triangles[area > 1e-12])


def _tube(top: float) -> Surface:
    """The mantle from z = 1 (radius `top`) to z = −1 (radius 1), and the caps."""
    slope = np.array([2.0, 1.0 - top]) / np.hypot(2.0, 1.0 - top)
    parts = [_turned(np.array([(top, 1.0), (1.0, -1.0)]), np.tile(slope, (2, 1)))]
    parts.append(_turned(np.array([(1.0, -1.0), (0.0, -1.0)]), np.tile([0.0, -1.0], (2, 1))))
    if top > 0.0:
        parts.append(_turned(np.array([(0.0, 1.0), (top, 1.0)]), np.tile([0.0, 1.0], (2, 1))))
    return joined(parts)


def _box() -> Surface:
    sides = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.roll([sign, 0.0, 0.0], axis)
            u, v = np.roll([0.0, 1.0, 0.0], axis), np.roll([0.0, 0.0, sign], axis)
            points = np.array([normal + a * u + b * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
            sides.append(Surface(points, np.tile(normal, (4, 1)), np.array([(0, 1, 2), (0, 2, 3)])))
    return joined(sides)
