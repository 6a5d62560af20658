"""Normal force between elastic adhesive spheres, and of one on a rigid obstacle.

Hertz 1882 (see K. L. Johnson, Contact Mechanics, 1985, §4.2); adhesion after Derjaguin, Muller, Toporov 1975,
doi:10.1016/0021-9797(75)90018-1.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from otwarp.scene import Material


def normal_force(overlap: float, radius: float, modulus: float, adhesion: float, reach: float) -> tuple[float, float]:
    """(force, stiffness) of an elastic contact [pN, pN/µm], positive when it repels.

    F = 4/3 E*√R δ^{3/2} − 2πRW for δ ≥ 0; −2πRW (1 + δ/reach) for −reach < δ < 0; 0 beyond. k = 2E*√(Rδ).

    Args:
        overlap: δ [µm].
        radius: R [µm].
        modulus: E* [pN/µm²].
        adhesion: W [pN/µm].
        reach: Gap over which the adhesion fades [µm].
    """
    pull = 2.0 * np.pi * radius * adhesion
    if overlap >= 0.0:
        return (
            4.0 / 3.0 * modulus * np.sqrt(radius) * overlap**1.5 - pull,
            2.0 * modulus * np.sqrt(radius * overlap),
        )
    return (-pull * (1.0 + overlap / reach) if overlap > -reach else 0.0), 0.0


def overlap_alone(hardness: float, give: float, reach: float) -> float:
    """δ with δ + give·K·δ^{3/2} = reach: where backward Euler takes a lone contact [µm]."""
    return brentq(lambda d: d + give * hardness * d**1.5 - reach, 0.0, reach, xtol=1e-300, rtol=1e-14)


def adhesion_of(a: Material, b: Material) -> tuple[float, float]:
    """(W, range) of a pair: those of the surface that adheres more; of equals the longer range."""
    return max((a.adhesion, a.adhesion_range), (b.adhesion, b.adhesion_range))


def sphere_pair(a: Material, radius_a: float, b: Material, radius_b: float, distance: float) -> tuple[float, float]:
    """(force, stiffness) between spheres whose centres are `distance` apart [pN, pN/µm]."""
    compliance = (1.0 - a.poisson_ratio**2) / a.youngs_modulus + (1.0 - b.poisson_ratio**2) / b.youngs_modulus
    radius = radius_a * radius_b / (radius_a + radius_b)
    return normal_force(radius_a + radius_b - distance, radius, 1.0 / compliance, *adhesion_of(a, b))


def sphere_obstacle(a: Material, radius: float, signed_distance: float) -> tuple[float, float]:
    """(force, stiffness) of a rigid, locally flat obstacle at `signed_distance` from the centre [pN, pN/µm]."""
    modulus = a.youngs_modulus / (1.0 - a.poisson_ratio**2)
    return normal_force(radius - signed_distance, radius, modulus, a.adhesion, a.adhesion_range)


def pair_forces(
    a: Material, centre_a: np.ndarray, radius_a: float, b: Material, centre_b: np.ndarray, radius_b: float
) -> tuple[np.ndarray, np.ndarray]:
    """Force vectors on a and on b [pN]."""
    way = np.asarray(centre_a, dtype=float) - centre_b
    distance = float(np.linalg.norm(way))
    force = sphere_pair(a, radius_a, b, radius_b, distance)[0] * way / distance
    return force, -force
