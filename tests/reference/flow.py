"""Background flow at a point: velocity and half its curl, in world axes."""

from __future__ import annotations

import numpy as np

from otwarp.scene import Flow
from tests.reference.rotations import matrix


def in_rectangle(y: float, z: float, b: float, h: float, terms: int = 2000) -> np.ndarray:
    """(u, ∂u/∂y, ∂u/∂z) for G = 1 in |y| < b, |z| < h by the double sine series, which knows neither side first.

    u = 16/π² Σ_mn ± cos(py) cos(qz) / (mn (p² + q²)), p = mπ/2b, q = nπ/2h, over odd m, n.
    """
    m = np.arange(1, terms, 2)[:, None]
    n = np.arange(1, terms, 2)[None]
    p, q = m * np.pi / (2 * b), n * np.pi / (2 * h)
    weight = 16.0 / np.pi**2 * (-1.0) ** ((m + n) // 2 - 1) / (m * n * (p**2 + q**2))
    cy, cz = np.cos(p * y), np.cos(q * z)
    return np.array(
        [(weight * cy * cz).sum(), -(weight * p * np.sin(p * y) * cz).sum(), -(weight * q * cy * np.sin(q * z)).sum()]
    )


def flow_at(flow: Flow, point: np.ndarray, radius: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(u + a²/6 ∇²u [µm/s], angular velocity ½∇×u [rad/s]) at a world `point` (3,) of a sphere of `radius` a [µm].

    uniform: u = U x̂; shear: u = γ̇ z x̂, ½γ̇ ŷ; poiseuille: u = U (1 − (z/h)²) x̂, −U z/h² ŷ, 0 outside |z| < h;
    rectangular: `in_rectangle`.
    """
    rotation = matrix(np.asarray(flow.orientation))
    if flow.kind == "rectangular":
        _, y, z = rotation.T @ (np.asarray(point, dtype=float) - flow.origin)
        if abs(y) >= flow.half_width or abs(z) >= flow.half_height:
            return np.zeros(3), np.zeros(3)
        u, by, bz = in_rectangle(y, z, flow.half_width, flow.half_height)
        scale = flow.speed / in_rectangle(0.0, 0.0, flow.half_width, flow.half_height)[0]
        mean = scale * (u - radius**2 / 6.0)
        return mean * rotation[:, 0], 0.5 * scale * (bz * rotation[:, 1] - by * rotation[:, 2])
    z = float((rotation.T @ (np.asarray(point, dtype=float) - flow.origin))[2])
    speed, turn = 0.0, 0.0
    if flow.kind == "uniform":
        speed = flow.speed
    elif flow.kind == "shear":
        speed, turn = flow.shear_rate * z, 0.5 * flow.shear_rate
    elif abs(z) < flow.half_height:
        laplacian = -2.0 * flow.speed / flow.half_height**2
        speed = flow.speed * (1.0 - (z / flow.half_height) ** 2) + radius**2 / 6.0 * laplacian
        turn = -flow.speed * z / flow.half_height**2
    return speed * rotation[:, 0], turn * rotation[:, 1]
