"""What a time integrator makes of a linear force: the exact statistics of its chain, to be told from a defect.

For a spring of rate κ [1/s] and h = κ·dt every integrator is x' = a·x + σ√(2h)·(b ξ_n + c ξ_{n+1}), σ² = k_B T/k. The
first-order autoregression gives variance and lagged covariance in closed form (Kloeden & Platen 1992,
doi:10.1007/978-3-662-12616-5, §9; Leimkuhler & Matthews 2013, doi:10.1093/amrx/abs010, for the averaged noise).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from otwarp.scene import Settings
from otwarp.scene.vocabulary.medium import SCENE

CHAINS: dict[str, Callable[[float], tuple[float, float, float]]] = {
    "eulerMaruyama": lambda h: (1.0 - h, 1.0, 0.0),
    "leimkuhlerMatthews": lambda h: (1.0 - h, 0.5, 0.5),
    "heun": lambda h: (1.0 - h + 0.5 * h * h, 1.0 - 0.5 * h, 0.0),
    "exponential": lambda h: (float(np.exp(-h)), float(np.sqrt(-np.expm1(-2.0 * h) / (2.0 * h))), 0.0),
}
"""(a, b, c) by name of the integrator."""

DEFAULT = Settings().integrator
"""Integrator of a scene that names none."""

OFFERED = SCENE["settings.integrator"].allowed
"""Integrators that a scene may name."""


def variance(integrator: str, h: float) -> float:
    """Stationary variance over k_B T/k: 2h(b² + c² + 2abc)/(1 − a²)."""
    a, b, c = CHAINS[integrator](h)
    return 2.0 * h * (b * b + c * c + 2.0 * a * b * c) / (1.0 - a * a)


def covariance(integrator: str, h: float, lag: int | np.ndarray) -> np.ndarray:
    """Covariance at `lag` steps over k_B T/k: C₁ = a·C₀ + 2h·b·c, then C_n = aⁿ⁻¹ C₁."""
    a, b, c = CHAINS[integrator](h)
    zero = variance(integrator, h)
    n = np.asarray(lag)
    return np.where(n == 0, zero, (a * zero + 2.0 * h * b * c) * a ** np.maximum(n - 1, 0))
