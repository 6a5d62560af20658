"""Motion and diffusion near hydrodynamic walls, with the divergence of the mobility by differences.

The kernels find ∇·M from derivatives of the resistance worked out on paper; here it is the definition: the mobility at
displaced poses, Σ_b X_b M e_b, with X_b the motions of the body along and about its own axes.
"""

from __future__ import annotations

import numpy as np

from otwarp.hydrodynamics.walls import body_resistance
from otwarp.laws.wall_fits import ENTRAINED, NORMAL, SLIDING
from tests.reference.rotations import exponential, matrix, multiply

STEP = 1e-5
"""Displacement for differences [µm, rad]: their error is its square over the gap's."""

Walls = tuple[np.ndarray, np.ndarray]
"""(m, 3) unit normals into the liquid and (m,) n·x on each wall [µm]."""


def sphere_mobility(position: np.ndarray, radius: float, walls: Walls) -> np.ndarray:
    """(3, 3) μ/μ₀ of a lone sphere that is free to rotate: superposed resistances, inverted."""
    resistance = np.eye(3)
    for n, offset in zip(*walls, strict=True):
        gap = (n @ position - offset) / radius - 1.0
        nn = np.outer(n, n)
        resistance += NORMAL(gap)[0] * nn + SLIDING(gap)[0] * (np.eye(3) - nn)
    return np.linalg.inv(resistance)


def sphere_divergence(position: np.ndarray, radius: float, walls: Walls) -> np.ndarray:
    """(3,) Σ_j ∂_j μ_ij/μ₀ [1/µm]."""
    total = np.zeros(3)
    for j in range(3):
        shift = STEP * radius * np.eye(3)[j]
        ahead, behind = (sphere_mobility(position + s, radius, walls) for s in (shift, -shift))
        total += (ahead - behind)[:, j] / (2.0 * STEP * radius)
    return total


def sphere_move(
    position: np.ndarray, radius: float, walls: Walls, spread: float, noise: np.ndarray, fourth: float
) -> np.ndarray:
    """(3,) noise and thermal drift of one step near ONE wall, in the axes of the wall.

    Δ = spread √μ ξ along each axis, and k_B T dt ∂μ⊥ ½(ξ_n² + ζ²) along the normal.
    """
    n = walls[0][0]
    gap = (n @ position - walls[1][0]) / radius - 1.0
    across, along = 1.0 / (1.0 + NORMAL(gap)[0]), 1.0 / (1.0 + SLIDING(gap)[0])
    normal = (n @ noise) * n
    drift = 0.5 * spread**2 * (n @ sphere_divergence(position, radius, walls)) * 0.5 * ((n @ noise) ** 2 + fourth**2)
    return spread * (np.sqrt(across) * normal + np.sqrt(along) * (noise - normal)) + drift * n


def sphere_carried(
    position: np.ndarray, radius: float, walls: Walls, flow: np.ndarray, mean: np.ndarray | None = None
) -> np.ndarray:
    """(3,) velocity of a lone sphere in a flow that stands at the walls; `mean` over its surface, None where it is
    `flow`, that at its centre."""
    pull = np.array(flow if mean is None else mean, dtype=float)
    for n, offset in zip(*walls, strict=True):
        gap = (n @ position - offset) / radius - 1.0
        pull += ENTRAINED(gap)[0] * (flow - (n @ flow) * n)
    return sphere_mobility(position, radius, walls) @ pull


def body_mobility(
    free: np.ndarray, spheres: np.ndarray, position: np.ndarray, orientation: np.ndarray, walls: Walls
) -> np.ndarray:
    """(6, 6) M in the body's axes at unit viscosity; `free` is R_free there, `spheres` (n, 4) offsets and radii."""
    return np.linalg.inv(body_resistance(free, spheres, position, matrix(orientation), *walls))


def body_divergence(
    free: np.ndarray, spheres: np.ndarray, position: np.ndarray, orientation: np.ndarray, walls: Walls
) -> np.ndarray:
    """(6,) drift per k_B T in the body's axes: Σ_b X_b M e_b, and ax M_tr for moving and turning separately."""
    total = np.zeros(6)
    here = matrix(orientation)
    for j in range(6):
        moved = []
        for sign in (1.0, -1.0):
            unit = sign * STEP * np.eye(6)[j]
            there = multiply(orientation, exponential(unit[3:]))
            moved.append(body_mobility(free, spheres, position + here @ unit[:3], there, walls))
        total += (moved[0] - moved[1])[:, j] / (2.0 * STEP)
    coupling = body_mobility(free, spheres, position, orientation, walls)[:3, 3:]
    total[:3] += sum(np.cross(np.eye(3)[j], coupling[:, j]) for j in range(3))
    return total
