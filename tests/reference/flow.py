"""Background flow at a point: velocity and half its curl, in world axes."""

from __future__ import annotations

import numpy as np

from otwarp.scene import Flow
from tests.reference.rotations import matrix


def flow_at(flow: Flow, point: np.ndarray, radius: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(u + a²/6 ∇²u [µm/s], angular velocity ½∇×u [rad/s]) at a world `point` (3,) of a sphere of `radius` a [µm].

    uniform: u = U x̂; shear: u = γ̇ z x̂, ½γ̇ ŷ; poiseuille: u = U (1 − (z/h)²) x̂, −U z/h² ŷ, 0 outside |z| < h.
    """
    rotation = matrix(np.asarray(flow.orientation))
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
