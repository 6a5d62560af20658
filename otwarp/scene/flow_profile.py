"""Velocity of the background flow on the host, and what follows from the section of a rectangular channel; NumPy.

Between the plates z = ±h and the walls y = ±b, b ≥ h, the velocity is the series

    u = G/2·(h² − z²) − G·16h²/π³ · Σ (−1)^((n−1)/2)/n³ · cosh(nπy/2h)/cosh(nπb/2h) · cos(nπz/2h),  n = 1, 3, 5, …

with G = −(∂p/∂x)/η (F. M. White, Viscous Fluid Flow, 3rd ed. 2006, eq. 3-48; H. Bruus, Theoretical Microfluidics, 2008,
section 3.4.6).
"""

from __future__ import annotations

import numpy as np

from otwarp.scene.description import Flow
from otwarp.scene.transforms import rotate

ODD = np.arange(1, 400, 2)


def sides(flow: Flow) -> tuple[float, float]:
    """Shorter and longer half side of a rectangular channel [µm]."""
    return min(flow.half_height, flow.half_width), max(flow.half_height, flow.half_width)


def drive(flow: Flow) -> float:
    """G of a rectangular channel for a speed of 1 on its centre line [1/µm²]."""
    h, b = sides(flow)
    signs = (-1.0) ** ((ODD - 1) // 2)
    # 1/cosh without its overflow
    falls = 2.0 * np.exp(-ODD * np.pi * b / (2 * h)) / (1.0 + np.exp(-ODD * np.pi * b / h))
    return 1.0 / (h**2 * (0.5 - 16.0 / np.pi**3 * float((signs / ODD**3 * falls).sum())))


def _in_channel(flow: Flow, across: np.ndarray, up: np.ndarray) -> np.ndarray:
    h, b = sides(flow)
    y, z = (np.abs(across), up) if flow.half_width >= flow.half_height else (np.abs(up), across)
    inside = (y < b) & (np.abs(z) < h)
    y, z = np.minimum(y, b)[:, None], z[:, None]
    signs = (-1.0) ** ((ODD - 1) // 2)
    a = ODD * np.pi / (2 * h)
    ratio = (np.exp(-a * (b - y)) + np.exp(-a * (b + y))) / (1.0 + np.exp(-2.0 * a * b))
    series = (signs / ODD**3 * ratio * np.cos(a * z)).sum(axis=1)
    u = 0.5 * (h**2 - z[:, 0] ** 2) - 16.0 * h**2 / np.pi**3 * series
    return np.where(inside, flow.speed * drive(flow) * u, 0.0)


def flow_velocity(flow: Flow, place: np.ndarray) -> np.ndarray:
    """(n, 3) velocity of a background flow [µm/s] at `place` (n, 3) [µm]; see `Flow`."""
    turn = np.array(flow.orientation)
    local = rotate(turn * [-1.0, -1.0, -1.0, 1.0], place - flow.origin)
    if flow.kind == "grid":
        assert flow.field is not None, "scenes are checked"
        return rotate(turn, flow.field.at(local))
    if flow.kind == "uniform":
        speed = np.full(len(place), flow.speed)
    elif flow.kind == "shear":
        speed = flow.shear_rate * local[:, 2]
    elif flow.kind == "rectangular":
        speed = _in_channel(flow, local[:, 1], local[:, 2])
    else:
        speed = flow.speed * np.maximum(0.0, 1.0 - (local[:, 2] / flow.half_height) ** 2)
    return speed[:, None] * rotate(turn, np.array([1.0, 0.0, 0.0]))
