"""What the codes of case b have in common: the spheres of `benchmarks.crowd`, in numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Spheres:
    """Spheres that repel each other with hardness·overlap^{3/2} and move by mobility·force + kick·ξ in a step.

    Attributes:
        start: (count, 3) float32 places [µm].
        diameter: [µm].
        hardness: 4/3·E*·√R [pN/µm^{3/2}].
        mobility: dt/γ [µm/pN].
        kick: √(2 D dt) [µm].
    """

    start: np.ndarray
    diameter: float
    hardness: float
    mobility: float
    kick: float

    @property
    def thermal(self) -> float:
        """k_B T [pN µm]."""
        return 0.5 * self.kick**2 / self.mobility

    def energy(self, distance: np.ndarray) -> np.ndarray:
        """Of pairs at a distance [pN µm]."""
        return 0.4 * self.hardness * np.maximum(self.diameter - distance, 0.0) ** 2.5


def spheres(count: int) -> Spheres:
    """As `benchmarks.crowd` makes them."""
    from benchmarks.crowd import DIFFUSED, RADIUS, SURFACE, start_places, time_step
    from otwarp.scene import Medium

    reduced = SURFACE.youngs_modulus / (2.0 * (1.0 - SURFACE.poisson_ratio**2))
    return Spheres(
        start=start_places(count),
        diameter=2.0 * RADIUS,
        hardness=4.0 / 3.0 * math.sqrt(0.5 * RADIUS) * reduced,
        mobility=time_step() / (6.0 * math.pi * Medium().viscosity * RADIUS),
        kick=2.0 * RADIUS * math.sqrt(2.0 * DIFFUSED),
    )
