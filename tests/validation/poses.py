"""Many poses at once, in float64: quaternions (x, y, z, w) on the last axis."""

from __future__ import annotations

import numpy as np

from otwarp.simulation.simulation import Simulation


def matrices(q: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotation matrices of quaternions of any length (float32 ones are unit to 1e-7)."""
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    v, w = q[..., :3], q[..., 3, None, None]
    outer = v[..., :, None] * v[..., None, :]
    cross = np.cross(v[..., None, :], np.eye(3)).swapaxes(-1, -2)  # cross @ a = v × a
    square = (v**2).sum(axis=-1)[..., None, None]
    return (w**2 - square) * np.eye(3) + 2.0 * outer + 2.0 * w * cross


def turns(now: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(..., 3) rotation vectors, in the body's axes at the start, that lead from `start` to `now`; angles below π."""
    a, b = start / np.linalg.norm(start, axis=-1, keepdims=True), now / np.linalg.norm(now, axis=-1, keepdims=True)
    # conj(a) ⊗ b
    w = a[..., 3] * b[..., 3] + (a[..., :3] * b[..., :3]).sum(axis=-1)
    v = a[..., 3:] * b[..., :3] - b[..., 3:] * a[..., :3] - np.cross(a[..., :3], b[..., :3])
    sign = np.where(w < 0.0, -1.0, 1.0)[..., None]
    half = np.linalg.norm(v, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(half, sign * w[..., None])
    return sign * v * np.where(half > 1e-12, angle / np.maximum(half, 1e-12), 2.0)


def pose(sim: Simulation, body: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(W, 3) reference points and (W, 4) orientations of one body, in float64, unit to rounding."""
    position = sim.state.position.numpy()[:, body].astype(float)
    orientation = sim.state.orientation.numpy()[:, body].astype(float)
    return position, orientation / np.linalg.norm(orientation, axis=-1, keepdims=True)
