"""Closed forms by which the stress tests judge: Hertz contact, springs, and the Boltzmann distribution on a floor.

Independent of the kernels: float64, host only. Units are the internal ones (µm, s, pN).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

POISSON_RATIO = 0.4
"""Of all bodies of the stress tests."""


def drag(radius: float, viscosity: float) -> float:
    """Stokes friction 6πηr [pN·s/µm] of a sphere of radius r [µm] in a liquid of viscosity η [Pa·s]."""
    return 6.0 * math.pi * viscosity * radius


def hardness(modulus: float, radius: float, *, bodies: int) -> float:
    """K of Hertz's law F = K·δ^{3/2}: 4/3·E*·√R (Hertz 1882, doi:10.1515/crll.1882.92.156).

    Args:
        modulus: Young's modulus of the elastic bodies [Pa].
        radius: Effective radius R [µm].
        bodies: How many of the two partners are elastic, 1 or 2.
    """
    return 4.0 / 3.0 * math.sqrt(radius) * modulus / (bodies * (1.0 - POISSON_RATIO**2))


def pressed_overlap(hard: float, pull: Callable[[float], float], largest: float) -> float:
    """Overlap δ at which K·δ^{3/2} balances a pull that falls with δ [µm], by bisection up to `largest`."""
    low, high = 0.0, largest
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if hard * middle**1.5 < pull(middle) else (low, middle)
    return 0.5 * (low + high)


def relaxed_overlap(start: float, hard: float, mobility: float, time: float) -> float:
    """Overlap of two free spheres after `time`: dδ/dt = −μ·K·δ^{3/2}, so δ^{−1/2} grows as μ·K·t/2.

    Args:
        start: Overlap at the start [µm].
        hard: K [pN/µm^{3/2}].
        mobility: Sum of both mobilities, µm/(pN·s).
        time: [s].
    """
    return (start**-0.5 + 0.5 * mobility * hard * time) ** -2


def mean_height(stiffness: float, below: float, hard: float, energy: float) -> tuple[float, float]:
    """Mean and standard deviation of the gap of a bead that a spring pulls onto a floor [µm].

    Boltzmann's distribution exp(−U/k_BT) of U(h) = k/2·(h + p)² for all h, + 2/5·K·(−h)^{5/2} for h < 0 (the work of
    Hertz's force), by the midpoint rule.

    Args:
        stiffness: k [pN/µm].
        below: p, how far the spring's centre is below the place where bead and floor just touch [µm].
        hard: K [pN/µm^{3/2}].
        energy: k_BT [pN·µm].
    """

    def potential(h: np.ndarray) -> np.ndarray:
        return 0.5 * stiffness * (h + below) ** 2 + 0.4 * hard * np.maximum(-h, 0.0) ** 2.5

    rough = np.concatenate([-np.geomspace(10.0, 1e-9, 200_000), np.geomspace(1e-9, 100.0, 200_000)])
    u = potential(rough)
    inside = rough[u < u.min() + 40.0 * energy]
    edges = np.linspace(inside[0], inside[-1], 400_001)
    h = 0.5 * (edges[1:] + edges[:-1])
    weight = np.exp(-(potential(h) - u.min()) / energy)
    mean = float(np.sum(weight * h) / np.sum(weight))
    return mean, math.sqrt(float(np.sum(weight * (h - mean) ** 2) / np.sum(weight)))


def followed(force: Callable[[np.ndarray], np.ndarray], start: np.ndarray, mobility: float, times: np.ndarray):
    """(n, d) places at `times` of a bead that a force moves without noise: ẋ = μ·F(x), in tight adaptive steps."""
    from scipy.integrate import solve_ivp

    done = solve_ivp(
        lambda _, x: mobility * force(x),
        (0.0, float(times[-1])),
        start,
        t_eval=times,
        rtol=1e-8,
        atol=1e-10,
        max_step=float(times[0]) / 8.0,
    )
    return done.y.T
