"""Small turns: unit quaternions (x, y, z, w) and rotation vectors, one at a time and without arrays of arrays.

Error states are turns in the axes of the world: q = exp(θ) q₀.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from otwarp.scene.transforms import conjugate, multiply


def exponential(turn: Sequence[float] | np.ndarray) -> np.ndarray:
    """(4) quaternion of the rotation vector `turn` [rad]."""
    x, y, z = turn
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 if angle < 1e-8 else math.sin(0.5 * angle) / angle
    return np.array([scale * x, scale * y, scale * z, math.cos(0.5 * angle)])


def logarithm(q: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3) shortest rotation vector of a unit quaternion [rad], of length 0 … π."""
    x, y, z, w = q
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-8 else 2.0 * math.atan2(sine, w) / sine
    return np.array([scale * x, scale * y, scale * z])


def product(a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray) -> np.ndarray:
    """(4) quaternion of first b, then a, of unit length."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    out = (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    )
    length = math.sqrt(sum(v * v for v in out))
    return np.array([v / length for v in out])


def difference(a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3) the turn in the axes of the world that leads from b to a [rad]."""
    x, y, z, w = b
    return logarithm(product(a, (-x, -y, -z, w)))


def differences(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n, 3) the turns in the axes of the world that lead from each of b to each of a, quaternions (n, 4) [rad]."""
    q = multiply(a, conjugate(b))
    q = q * np.where(q[:, 3:] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(q[:, :3], axis=1)
    small = sine < 1e-8
    scale = np.where(small, 2.0, 2.0 * np.arctan2(sine, q[:, 3]) / np.where(small, 1.0, sine))
    return scale[:, None] * q[:, :3]


def cross(a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3) a × b; `np.cross` takes one pair twenty times as long."""
    ax, ay, az = a
    bx, by, bz = b
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def cross_matrix(v: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3, 3) matrix of w → v × w."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def jacobian(turn: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3, 3) J with exp(θ + ε) = exp(J ε) exp(θ) to first order in ε: the left Jacobian of the rotation vector θ."""
    x, y, z = turn
    angle = math.sqrt(x * x + y * y + z * z)
    a, b = 0.5, 1.0 / 6.0
    if angle >= 1e-4:
        a, b = (1.0 - math.cos(angle)) / angle**2, (angle - math.sin(angle)) / angle**3
    # 1 + a [θ]× + b [θ]×², by its nine numbers
    return np.array([
        [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
        [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
        [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
    ])  # fmt: skip
