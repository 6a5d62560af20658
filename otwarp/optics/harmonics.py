"""Angular functions: Wigner d, Bessel functions of all orders at once, and the operators of momentum flux.

A wave of helicity σ has the angular amplitude Σ c_nm D(n, m, σ), with D built on d^n_{mσ}(t) exp(imp). In this basis
the direction operator s = (sin t cos p, sin t sin p, cos t) couples (n, m) to its neighbours only, so the momentum of
a field is a sum over its coefficients (Varshalovich, Moskalev, Khersonskii 1988, ch. 4 and 5).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.special import roots_legendre


def wigner_d(orders: int, m: int, helicity: int, cosine: np.ndarray) -> np.ndarray:
    """√((2n+1)/4π) d^n_{mσ}(t) for n = 0 … orders by upward recurrence in n, which is stable.

    Args:
        orders: Highest n.
        m: Azimuthal number.
        helicity: σ = ±1.
        cosine: (q,) cos t.

    Returns:
        (q, orders + 1); zero for n < max(|m|, 1).
    """
    lowest = max(abs(m), 1)
    out = np.zeros((orders + 1, len(cosine)))
    if lowest > orders:
        return out.T
    half_sine, half_cosine = np.sqrt(0.5 * (1.0 - cosine)), np.sqrt(0.5 * (1.0 + cosine))
    a, b = abs(m - helicity), abs(m + helicity)
    log_size = 0.5 * (math.lgamma(2 * lowest + 1) - math.lgamma(a + 1) - math.lgamma(b + 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        powers = (a * np.log(half_sine) if a else 0.0) + (b * np.log(half_cosine) if b else 0.0)
        start = np.exp(log_size + powers)
    out[lowest] = start if helicity >= m else start * (-1.0) ** (m - helicity)
    square = m * m
    for n in range(lowest, orders):
        up = math.sqrt(((n + 1) ** 2 - square) * ((n + 1) ** 2 - 1)) / ((n + 1) * (2 * n + 1))
        middle = (cosine - m * helicity / (n * (n + 1))) * out[n]
        if n > lowest:
            middle -= math.sqrt((n * n - square) * (n * n - 1)) / (n * (2 * n + 1)) * out[n - 1]
        out[n + 1] = middle / up
    return (out * np.sqrt((2.0 * np.arange(orders + 1) + 1.0) / (4.0 * math.pi))[:, None]).T


@lru_cache(maxsize=32)
def gauss_legendre(nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on (−1, 1); for many nodes by SciPy, whose eigenvalue problem is banded and not dense."""
    return np.polynomial.legendre.leggauss(nodes) if nodes < 512 else roots_legendre(nodes)


def bessel_j(orders: int, x: np.ndarray) -> np.ndarray:
    """J_j(x) for j = 0 … orders and all x ≥ 0 at once, by Miller's downward recurrence.

    Normalised with 1 = J₀ + 2 Σ J_2k; absolute error near 1e-15 (Gautschi 1967, doi:10.1137/1009002).

    Returns:
        (orders + 1, *x.shape).
    """
    top = float(np.max(x, initial=0.0))
    start = 2 * (int(max(orders, top) + 12.0 * max(orders, top, 1.0) ** (1.0 / 3.0)) // 2) + 16
    safe = np.maximum(x, 1e-14)
    above, here = np.zeros_like(safe), np.full_like(safe, 1e-300)
    total = np.zeros_like(safe)
    out = np.empty((orders + 1, *x.shape))
    inverse = 2.0 / safe
    for j in range(start, -1, -1):
        if j <= orders:
            out[j] = here
        total += here if j == 0 else (2.0 * here if j % 2 == 0 else 0.0)
        if j == 0:
            break
        above, here = here, j * inverse * here - above
        # keep far from overflow: all kept values share the scale
        large = np.abs(here) > 1e200
        if np.any(large):
            scale = np.where(large, 1e-200, 1.0)
            here, above, total = here * scale, above * scale, total * scale
            out[j : orders + 1] *= scale
    return out / total


def along_axis(coefficients: np.ndarray, helicity: int) -> np.ndarray:
    """cos t applied to a field of one helicity; axes (m from −M to M, points, n from 0 to N), N the largest |m|."""
    n, m = _numbers(coefficients)
    safe = np.maximum(n, 1)
    out = m * helicity / (safe * (safe + 1.0)) * coefficients
    step = np.sqrt(np.maximum((n**2 - m**2) * (n**2 - 1.0), 0.0) / (safe**2 * (4.0 * safe**2 - 1.0)))
    out[..., 1:] += step[..., 1:] * coefficients[..., :-1]
    out[..., :-1] += step[..., 1:] * coefficients[..., 1:]
    return out


def across_axis(coefficients: np.ndarray, helicity: int) -> np.ndarray:
    """sin t exp(ip) applied to a field of one helicity; same axes as `along_axis`, raises m by one."""
    n, m = _numbers(coefficients)
    safe = np.maximum(n, 1)
    out = np.zeros_like(coefficients)
    up = np.sqrt((n + m + 1.0) * (n + m + 2.0) * ((n + 1.0) ** 2 - 1.0) * (n >= np.abs(m)))
    up /= (n + 1.0) * np.sqrt((2.0 * n + 1.0) * (2.0 * n + 3.0))
    down = np.sqrt(np.maximum((n - m) * (n - m - 1.0) * (n**2 - 1.0), 0.0))
    down /= safe * np.sqrt((2.0 * safe - 1.0) * (2.0 * safe + 1.0))
    level = helicity * np.sqrt(np.maximum((n - m) * (n + m + 1.0), 0.0)) / (safe * (safe + 1.0))
    out[1:, :, 1:] -= (up * coefficients)[:-1, :, :-1]
    out[1:, :, :-1] += (down * coefficients)[:-1, :, 1:]
    out[1:] += (level * coefficients)[:-1]
    return out


def raise_m(coefficients: np.ndarray) -> np.ndarray:
    """J₊ = J_x + iJ_y: √((n − m)(n + m + 1)) from (n, m) to (n, m + 1)."""
    n, m = _numbers(coefficients)
    out = np.zeros_like(coefficients)
    out[1:] = (np.sqrt(np.maximum((n - m) * (n + m + 1.0), 0.0)) * coefficients)[:-1]
    return out


def _numbers(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """n and m of the coefficient array, shaped to broadcast over it."""
    highest = (coefficients.shape[0] - 1) // 2
    n = np.arange(coefficients.shape[2], dtype=float)[None, None, :]
    m = np.arange(-highest, highest + 1, dtype=float)[:, None, None]
    return n, m
