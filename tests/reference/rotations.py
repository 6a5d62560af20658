"""Unit quaternions (x, y, z, w) in float64."""

from __future__ import annotations

import numpy as np


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Hamilton product p ⊗ q: the rotation q followed by p."""
    (px, py, pz, pw), (qx, qy, qz, qw) = p, q
    return np.array(
        [
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
            pw * qw - px * qx - py * qy - pz * qz,
        ]
    )


def matrix(q: np.ndarray) -> np.ndarray:
    """(3, 3) rotation matrix of a unit quaternion: turns vectors of the local frame into the outer frame."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def exponential(angle: np.ndarray) -> np.ndarray:
    """Unit quaternion of the rotation vector `angle` [rad]: (sin(θ/2) n, cos(θ/2)), exact down to θ = 0."""
    half = 0.5 * np.linalg.norm(angle)
    return np.append(0.5 * np.sinc(half / np.pi) * np.asarray(angle, dtype=float), np.cos(half))
