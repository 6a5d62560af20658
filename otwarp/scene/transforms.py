"""Rigid transforms in float64: USD's row-vector matrices to positions, quaternions (x, y, z, w) and scales."""

from __future__ import annotations

import numpy as np

ROUNDING = 1e-14
"""Scales this close to 1 are 1: a rotation's rounding must not change a radius."""

SHEAR_TOLERANCE = 1e-5
"""Largest allowed cosine between axes; single-precision quaternions reach 1e-7."""


def decompose(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Split row-vector matrices (x' = x·M) into translation, rotation and scale along the local axes.

    Args:
        matrices: (n, 4, 4).

    Returns:
        Positions (n, 3), quaternions (n, 4) with consecutive signs continuous, scales (n, 3) (the first is negative
        for a reflection), and the largest cosine between two axes (n,), which is 0 without shear.
    """
    axes = matrices[:, :3, :3]
    scale = np.linalg.norm(axes, axis=2)
    scale = np.where(np.abs(scale - 1.0) < ROUNDING, 1.0, scale)
    scale[np.linalg.det(axes) < 0.0, 0] *= -1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        rotation = axes / scale[:, :, None]
    gram = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3))
    gram[:, [0, 1, 2], [0, 1, 2]] = 0.0
    return matrices[:, 3, :3].copy(), quaternions(rotation.transpose(0, 2, 1)), scale, gram.max(axis=(1, 2))


def quaternions(rotations: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) of column-vector rotation matrices (n, 3, 3): first w ≥ 0, then the nearer sign.

    Of the four equivalent formulas, the one with the largest divisor is used (S. W. Shepperd, J. Guidance and
    Control 1, 223, 1978, doi:10.2514/3.55767b).
    """
    r = rotations
    diagonal = np.stack([r[:, 0, 0], r[:, 1, 1], r[:, 2, 2], r.trace(axis1=1, axis2=2)], axis=1)
    out = np.empty((len(r), 4))
    for n, choice in enumerate(diagonal.argmax(axis=1)):
        out[n] = _quaternion(r[n], int(choice))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    if len(out) and out[0, 3] < 0.0:
        out[0] *= -1.0
    return continuous(out)


def _quaternion(r: np.ndarray, choice: int) -> np.ndarray:
    q = np.empty(4)
    if choice == 3:
        q[3] = 1.0 + r[0, 0] + r[1, 1] + r[2, 2]
        q[0], q[1], q[2] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
        return q
    i, j, k = choice, (choice + 1) % 3, (choice + 2) % 3
    q[i] = 1.0 + r[i, i] - r[j, j] - r[k, k]
    q[j], q[k], q[3] = r[j, i] + r[i, j], r[k, i] + r[i, k], r[k, j] - r[j, k]
    return q


def continuous(q: np.ndarray) -> np.ndarray:
    """The same rotations (n, 4) with signs flipped so that neighbours lie in the same half space."""
    if len(q) < 2:
        return q
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(flips)])[:, None]


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """Column-vector rotation matrix (3, 3) of the unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def look_at(eye: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Quaternion of a camera at `eye` whose −Z points to `target` and whose Y leans to `up`."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross(up, back)
    if np.linalg.norm(right) < 1e-9:  # looking along `up`: any other axis serves
        right = np.cross([0.0, 1.0, 0.0] if abs(back[1]) < 0.9 else [0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return quaternions(np.stack([right, np.cross(back, right), back], axis=1)[None])[0]


def align_z(direction: np.ndarray) -> np.ndarray:
    """Quaternion of the shortest rotation that takes +Z to the unit vector `direction`."""
    x, y, z = direction
    if z < -1.0 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])
    q = np.array([-y, x, 0.0, 1.0 + z])
    return q / np.linalg.norm(q)


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Rotate vectors (..., 3) by unit quaternions (..., 4) in (x, y, z, w); shapes broadcast."""
    q, v = np.asarray(q, dtype=float), np.asarray(v, dtype=float)
    t = 2.0 * _cross(q, v)
    return v + q[..., 3:] * t + _cross(q, t)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """`np.cross` of the first three numbers of rows, which takes a few vectors ten times as long."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def conjugate(q: np.ndarray) -> np.ndarray:
    """The inverse rotations of unit quaternions (..., 4)."""
    return np.asarray(q, dtype=float) * (-1.0, -1.0, -1.0, 1.0)


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternion product: first b, then a. Shapes (..., 4) broadcast."""
    ax, ay, az, aw = np.moveaxis(np.asarray(a, float), -1, 0)
    bx, by, bz, bw = np.moveaxis(np.asarray(b, float), -1, 0)
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )
