"""Mie coefficients of a homogeneous sphere."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from otwarp.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Particle:
    """A homogeneous sphere: radius [µm] and refractive index (complex with positive imaginary part if it absorbs).

    Raises:
        InputError: A radius that is not above 0, or an index that no sphere has.
    """

    radius: float
    index: complex = 1.52

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            raise InputError(f"sphere radius is {self.radius:g} µm; allowed: above 0")
        index = complex(self.index)
        if not (math.isfinite(index.real) and index.real > 0.0 and 0.0 <= index.imag < math.inf):
            raise InputError(f"sphere index is {self.index}; allowed: real part above 0, imaginary part 0 or more")


def highest_order(x: float) -> int:
    """Multipole order beyond which a sphere of size parameter x scatters less than rounding.

    Wiscombe's criterion (1980, doi:10.1364/AO.19.001505) is for 1e-8; the factor 6 instead of 4.05 carries it to 1e-14.
    """
    return math.ceil(x + 6.0 * x ** (1.0 / 3.0) + 6.0)


def mie_coefficients(x: float, ratio: complex, orders: int) -> tuple[np.ndarray, np.ndarray]:
    """Electric and magnetic scattering coefficients a_n, b_n for n = 1 … orders.

    Bohren and Huffman 1983, eq. 4.88, with the logarithmic derivative D_n(mx) by downward recurrence, which is stable
    for complex index; time factor exp(−iωt).

    Args:
        x: Size parameter k·r in the medium.
        ratio: Index of the sphere over that of the medium.
        orders: Highest multipole order.
    """
    z = ratio * x
    start = int(max(orders, abs(z))) + 16
    d = np.zeros(start + 1, dtype=complex)
    for n in range(start, 0, -1):
        d[n - 1] = n / z - 1.0 / (d[n] + n / z)
    d = d[1 : orders + 1]
    psi = _riccati_psi(x, orders)
    chi = _riccati_chi(x, orders)
    xi = psi - 1j * chi
    n = np.arange(1, orders + 1)
    electric = d / ratio + n / x
    magnetic = d * ratio + n / x
    a = (electric * psi[1:] - psi[:-1]) / (electric * xi[1:] - xi[:-1])
    b = (magnetic * psi[1:] - psi[:-1]) / (magnetic * xi[1:] - xi[:-1])
    return a, b


def _riccati_psi(x: float, orders: int) -> np.ndarray:
    """ψ_n(x) = x j_n(x), n = 0 … orders, by downward recurrence of the ratio ψ_n/ψ_{n−1}."""
    start = int(max(orders, x)) + 32
    ratio = np.zeros(start + 2)
    for n in range(start, 0, -1):
        ratio[n] = 1.0 / ((2 * n + 1) / x - ratio[n + 1])
    psi = np.empty(orders + 1)
    # ψ₀ = sin x vanishes at multiples of π: then start from ψ₁ = sin x/x − cos x
    psi[0] = math.sin(x)
    if orders:
        psi[1] = math.sin(x) / x - math.cos(x) if abs(math.sin(x)) < 0.5 and x > 0.5 else psi[0] * ratio[1]
    for n in range(2, orders + 1):
        psi[n] = psi[n - 1] * ratio[n] if n > x else (2 * n - 1) / x * psi[n - 1] - psi[n - 2]
    return psi


def _riccati_chi(x: float, orders: int) -> np.ndarray:
    """χ_n(x) = −x y_n(x), n = 0 … orders, by upward recurrence."""
    chi = np.empty(orders + 1)
    chi[0] = math.cos(x)
    if orders:
        chi[1] = math.cos(x) / x + math.sin(x)
    for n in range(2, orders + 1):
        chi[n] = (2 * n - 1) / x * chi[n - 1] - chi[n - 2]
    return chi
