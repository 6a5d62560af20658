"""Vector spherical harmonics, spherical Bessel functions and rotations of expansions, for waves around a point.

With Y the orthonormal spherical harmonics (Condon–Shortley phase),

    Ψ = r ∇Y/√(n(n+1)),   Φ = r̂ × Ψ,
    M = z_n(kr) Φ,        N = √(n(n+1)) z_n(kr)/(kr) Y r̂ + (kr z_n)′/(kr) Ψ,

z_n is j_n for regular waves and h_n⁽¹⁾ for outgoing ones, time goes as exp(−iωt); ∇ × M = −k N and ∇ × N = −k M. Orders
are counted as n² + n + m − 1, n = 1 … highest.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import spherical_jn, spherical_yn


def orders(highest: int) -> tuple[np.ndarray, np.ndarray]:
    """n and m of all orders up to the highest, in their sequence."""
    n = np.repeat(np.arange(1, highest + 1), 2 * np.arange(1, highest + 1) + 1)
    return n, np.arange(len(n)) - (n * n + n - 1)


def legendre(highest: int, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """θ parts of Y, ∂Y/∂θ and m Y/sin θ for m ≥ 0, each (highest + 1, highest + 1, …) by (n, m).

    Upward recurrence in n from the diagonal, in the normalisation of Y, which neither grows nor underflows below
    orders of some hundreds (Holmes and Featherstone 2002, doi:10.1007/s00190-002-0216-2).
    """
    c = np.asarray(cosine, dtype=float)
    s = np.sqrt(np.maximum(1.0 - c * c, 0.0))
    p = np.zeros((highest + 2, highest + 2, *c.shape))
    over = np.zeros_like(p)  # P/sin θ for m ≥ 1, finite on the axis
    p[0, 0] = math.sqrt(0.25 / math.pi)
    for m in range(1, highest + 2):
        factor = -math.sqrt((2 * m + 1) / (2 * m))
        over[m, m] = factor * p[m - 1, m - 1]
        p[m, m] = over[m, m] * s
    for m in range(highest + 1):
        for n in range(m + 1, highest + 2):
            a = math.sqrt((4 * n * n - 1) / (n * n - m * m))
            b = 0.0 if n < m + 2 else math.sqrt(((n - 1) ** 2 - m * m) / (4 * (n - 1) ** 2 - 1))
            p[n, m] = a * (c * p[n - 1, m] - (b * p[n - 2, m] if b else 0.0))
            if m:
                over[n, m] = a * (c * over[n - 1, m] - (b * over[n - 2, m] if b else 0.0))
    slope = np.zeros_like(p[: highest + 1, : highest + 1])
    for n in range(highest + 1):
        for m in range(n + 1):
            up = math.sqrt((n - m) * (n + m + 1)) * p[n, m + 1]
            if m == 0:
                slope[n, 0] = up
            else:
                slope[n, m] = 0.5 * (up - math.sqrt((n + m) * (n - m + 1)) * p[n, m - 1])
    m = np.arange(highest + 1).reshape(1, -1, *(1,) * c.ndim)
    return p[: highest + 1, : highest + 1], slope, m * over[: highest + 1, : highest + 1]


def tangential(highest: int, cosine: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(orders, 2, …) components of Ψ along θ̂ and φ̂; Φ has (−Ψ_φ, Ψ_θ)."""
    _, slope, over = legendre(highest, cosine)
    n, m = orders(highest)
    size = np.abs(m)
    sign = np.where(m < 0, (-1.0) ** size, 1.0).reshape(-1, *(1,) * np.ndim(cosine))
    turn = np.exp(1j * m.reshape(-1, *(1,) * np.ndim(cosine)) * angle)
    norm = sign / np.sqrt(n * (n + 1.0)).reshape(sign.shape)
    direction = np.where(m < 0, -1.0, 1.0).reshape(sign.shape)
    return np.stack([norm * slope[n, size] * turn, 1j * direction * norm * over[n, size] * turn], axis=1)


def bessel(highest: int, x: np.ndarray, *, outgoing: bool) -> tuple[np.ndarray, np.ndarray]:
    """z_n(x) and (x z_n)′/x, n = 0 … highest, each (highest + 1, …)."""
    x = np.asarray(x, dtype=float)
    n = np.arange(highest + 1).reshape(-1, *(1,) * x.ndim)
    z: np.ndarray = spherical_jn(n, x)
    slope: np.ndarray = spherical_jn(n, x, derivative=True)
    if outgoing:
        z = z + 1j * spherical_yn(n, x)
        slope = slope + 1j * spherical_yn(n, x, derivative=True)
    return z, z / x + slope


def wigner(n: int, beta: float) -> np.ndarray:
    """(2n + 1, 2n + 1) rotation matrix d of order n by β about y, rows and columns m = −n … n.

    By the eigenvectors of J_y, which loses nothing at high orders (Feng et al. 2015, doi:10.1103/PhysRevE.92.043307).
    """
    m = np.arange(-n, n)
    step = 0.5 * np.sqrt(n * (n + 1.0) - m * (m + 1.0))
    j_y = np.diag(-1j * step, -1) + np.diag(1j * step, 1)
    values, vectors = np.linalg.eigh(j_y)
    return np.real((vectors * np.exp(-1j * beta * np.round(values))) @ vectors.conj().T)
