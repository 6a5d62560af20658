"""Signed distance (positive outside) and outward unit normal of each shape, at one point of its local frame.

Where the nearest surface point is not unique the choice is: sign(0) = +1; the first of x, y, z inside a box; the cap
inside a cylinder; +x on the axis of a cylinder or capsule; +z at the centre of a sphere.
"""

from __future__ import annotations

import numpy as np

from tests.reference.rotations import matrix

Result = tuple[float, np.ndarray]
X, Z = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])


def plane(point: np.ndarray, size: np.ndarray) -> Result:
    """Half space z < 0."""
    return float(point[2]), Z


def sphere(point: np.ndarray, size: np.ndarray) -> Result:
    """Radius size[0]."""
    r = float(np.linalg.norm(point))
    return r - size[0], point / r if r > 0.0 else Z


def box(point: np.ndarray, size: np.ndarray) -> Result:
    """Half extents `size`: to the nearest surface point outside, to the nearest face inside."""
    nearest = np.clip(point, -np.asarray(size), size)
    way = point - nearest
    distance = float(np.linalg.norm(way))
    if distance > 0.0:
        return distance, way / distance
    depth = np.asarray(size) - np.abs(point)
    face = int(np.argmin(depth))
    return -float(depth[face]), np.eye(3)[face] * (-1.0 if point[face] < 0.0 else 1.0)


def cylinder(point: np.ndarray, size: np.ndarray) -> Result:
    """Capped cylinder about z, radius size[0], half height size[1]."""
    radius, half = size[0], size[1]
    rho = float(np.hypot(point[0], point[1]))
    radial = np.array([point[0] / rho, point[1] / rho, 0.0]) if rho > 0.0 else X
    cap = -Z if point[2] < 0.0 else Z
    side, end = rho - radius, abs(float(point[2])) - half
    if side > 0.0 and end > 0.0:
        distance = float(np.hypot(side, end))
        return distance, (side * radial + end * cap) / distance
    return (side, radial) if side > end else (end, cap)


def capsule(point: np.ndarray, size: np.ndarray) -> Result:
    """Capsule about z, radius size[0], half height of the straight part size[1]."""
    way = point - np.array([0.0, 0.0, np.clip(point[2], -size[1], size[1])])
    r = float(np.linalg.norm(way))
    return r - size[0], way / r if r > 0.0 else X


SHAPES = {"plane": plane, "box": box, "sphere": sphere, "cylinder": cylinder, "capsule": capsule}


def signed_distance(
    shape: str, size: np.ndarray, position: np.ndarray, orientation: np.ndarray, point: np.ndarray
) -> Result:
    """Distance and outward normal (world axes) at a world `point` of a shape with a pose."""
    rotation = matrix(np.asarray(orientation, dtype=float))
    local = rotation.T @ (np.asarray(point, dtype=float) - position)
    distance, normal = SHAPES[shape](local, np.asarray(size, dtype=float))
    return distance, rotation @ normal
