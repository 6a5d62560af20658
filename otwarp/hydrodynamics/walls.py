"""Walls: mobility of spheres and rigid bodies near no-slip planes (float64).

One sphere near one wall has the exact resistances of `bispherical`, by the fits of `otwarp.laws.wall_fits`. A body of
several spheres, or a channel of several walls, has R = R_free + Σ K_iᵀ ΔR_i(h_i) K_i: each sphere adds its own excess
for each wall, as in Oseen's superposition. This is exact for one sphere and right for whichever sphere is nearly in
contact, which then decides; images of the other spheres, and of one wall in the other, are left out.

Sources: those of `bispherical`; C. W. Oseen, Hydrodynamik (1927); J. F. Brady, G. Bossis, Annu. Rev. Fluid Mech. 20,
111 (1988), doi:10.1146/annurev.fl.20.010188.000551 (superposed resistances).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from otwarp.hydrodynamics.rigid import shift
from otwarp.hydrodynamics.rpy import cross_matrix
from otwarp.laws.wall_fits import COUPLING, NORMAL, PARALLEL, ROLL, SLIDING, SPIN


def sphere_mobility(gap: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mobility of a lone sphere free to rotate near one wall, over that of the free sphere.

    Args:
        gap: h/a − 1, any shape [1].

    Returns:
        (μ⊥/μ₀, μ∥/μ₀, d(μ⊥/μ₀)/dg), each the shape of `gap`. The thermal drift along the normal is
        k_B T μ₀/a times the last.
    """
    normal, slope = NORMAL(gap)
    along, _ = SLIDING(gap)
    return 1.0 / (1.0 + normal), 1.0 / (1.0 + along), -slope / (1.0 + normal) ** 2


def sphere_excess(gap: float, radius: float, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Excess resistance ΔR (6, 6) of a sphere about its centre at unit viscosity, and dΔR/dh.

    ΔR = [[A, B], [Bᵀ, C]] with A = 6πa(E⊥ nnᵀ + E∥(1 − nnᵀ)), B = 6πa² E_c [n]×, C = 8πa³(E_s nnᵀ + E_r(1 − nnᵀ)).

    Args:
        gap: h/a − 1 [1].
        radius: a [µm].
        normal: (3,) unit normal n out of the wall.

    Returns:
        In units of (µm, µm², µm³) and per µm, order (velocity, angular velocity) → (force, torque).
    """
    nn = np.outer(normal, normal)
    along = np.eye(3) - nn
    cross = cross_matrix(np.asarray(normal))
    rows = []
    for k, per in ((0, 1.0), (1, radius)):
        a = 6.0 * np.pi * radius * (NORMAL(gap)[k] * nn + PARALLEL(gap)[k] * along)
        b = 6.0 * np.pi * radius**2 * COUPLING(gap)[k] * cross
        c = 8.0 * np.pi * radius**3 * (SPIN(gap)[k] * nn + ROLL(gap)[k] * along)
        rows.append(np.block([[a, b], [b.T, c]]) / per)
    return rows[0], rows[1]


def body_resistance(
    free: np.ndarray,
    spheres: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    normals: np.ndarray,
    offsets: np.ndarray,
) -> np.ndarray:
    """Resistance R (6, 6) of a rigid body near walls, in its own axes, at unit viscosity: R_free + Σ Kᵀ ΔR K.

    Args:
        free: (6, 6) R_free about the reference point, body axes.
        spheres: (n, 4) offsets from the reference point, body axes, and radii [µm].
        position: (3,) reference point [µm].
        rotation: (3, 3) from body to world axes.
        normals: (m, 3) unit normals of the walls, out of them, world axes.
        offsets: (m,) n·x on each wall [µm].
    """
    total = np.array(free, dtype=float)
    for normal, offset in zip(normals, offsets, strict=True):
        n = rotation.T @ normal
        for x, y, z, radius in spheres:
            arm = np.array([x, y, z])
            gap = (normal @ position + n @ arm - offset) / radius - 1.0
            motion = shift(-arm)  # u = U + Ω × arm
            total += motion.T @ sphere_excess(float(gap), radius, n)[0] @ motion
    return total
