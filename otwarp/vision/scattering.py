"""Light scattered by several spheres, exactly: Mie's solution for each, in the field of all others.

What leaves a sphere is the answer of its T-matrix (Mie's coefficients) to what arrives there: the plane wave, and the
waves of the other spheres, led to its centre by the translation of vector spherical waves (Mackowski and Mishchenko
1996, doi:10.1364/JOSAA.13.002266). All reflections between spheres are in it, and polarisation; spheres may touch but
not overlap.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from otwarp.errors import InputError
from otwarp.optics.mie import mie_coefficients
from otwarp.vision.harmonics import bessel, legendre, orders, tangential, wigner
from otwarp.vision.specimen import Specimen

RESIDUAL = 1e-6
"""At which the waves between spheres are taken as settled, relative to those that arrive from outside."""

ROUNDS = 200
"""Of waves between spheres, at most."""


def highest_order(x: float, *, touching: bool) -> int:
    """Order at which expansions around a sphere of size parameter x are cut.

    Wiscombe's number for light that arrives from afar; more where another sphere's near field arrives, as a test shows.
    """
    return math.ceil(x + 4.05 * x ** (1.0 / 3.0) + (4 if touching else 2))


class Cluster:
    """Spheres that scatter together.

    Args:
        specimen: Spheres only.
        medium_index: Of what is around them.
        wavelength: In vacuum [µm].
        highest: Order of all expansions; None: from the spheres' sizes.

    Raises:
        InputError: A capsule, or spheres that overlap.
    """

    def __init__(self, specimen: Specimen, medium_index: float, wavelength: float, *, highest: int | None = None):
        if np.any(specimen.start != specimen.end):
            raise InputError("the specimen has capsules; allowed for method mie: spheres")
        self.specimen, self.k = specimen, 2.0 * math.pi * medium_index / wavelength
        place, radius = specimen.start, specimen.radius
        for i in range(len(radius)):
            for j in range(i):
                gap = float(np.linalg.norm(place[i] - place[j])) - radius[i] - radius[j]
                if gap < -1e-9 * radius[i]:
                    raise InputError(f"spheres {j} and {i} of the specimen overlap by {-gap:.3g} µm; "
                                     "allowed for method mie: spheres that touch at most")  # fmt: skip
        largest = self.k * float(radius.max())
        self.highest = highest or highest_order(largest, touching=len(radius) > 1)
        self.n, self.m = orders(self.highest)
        self._response = np.stack([self._mie(r, i / medium_index) for r, i in zip(radius, specimen.index, strict=True)])
        self._turns: dict[float, list[np.ndarray]] = {}
        self._steps: dict[tuple[float, float], Any] = {}

    def _mie(self, radius: float, ratio: float) -> np.ndarray:
        """(orders, 2) what leaves a sphere in M and N for a unit that arrives."""
        electric, magnetic = mie_coefficients(self.k * radius, ratio, self.highest)
        return -np.stack([magnetic, electric], axis=1)[self.n - 1]

    def scattered(self, direction: np.ndarray, polarisation: np.ndarray) -> np.ndarray:
        """(spheres, orders, 2, w) outgoing waves around each sphere for plane waves of unit amplitude.

        Args:
            direction: (w, 3) unit vectors.
            polarisation: (w, 3) unit vectors across them.

        Raises:
            InputError: The waves between spheres do not settle.
        """
        place = self.specimen.start
        arrives = plane_wave(self.highest, direction, polarisation)
        phase = np.exp(1j * self.k * place @ direction.T)
        outside = self._response[..., None] * arrives * phase[:, None, None, :]
        if len(place) == 1:
            return outside
        return self._settled(outside)

    def _settled(self, outside: np.ndarray) -> np.ndarray:
        """Solve x = outside + T A x for all plane waves at once, by GMRES over all of them."""
        from scipy.sparse.linalg import LinearOperator, gmres

        shape = outside.shape

        def left(x: np.ndarray) -> np.ndarray:
            waves = x.reshape(shape)
            return (waves - self._response[..., None] * self._between(waves)).ravel()

        size = outside.size
        operator = LinearOperator((size, size), matvec=left, dtype=complex)  # type: ignore[call-arg]
        found, info = gmres(
            operator, outside.ravel(), x0=outside.ravel(), rtol=RESIDUAL, restart=30, maxiter=ROUNDS // 30
        )
        if info:
            raise InputError(
                "waves between the spheres of the specimen do not settle; allowed: fewer or weaker spheres"
            )
        return found.reshape(shape)

    def _between(self, waves: np.ndarray) -> np.ndarray:
        """What arrives at each sphere from all others."""
        out = np.zeros_like(waves)
        place = self.specimen.start
        for i in range(len(place)):
            for j in range(len(place)):
                if i != j:
                    out[j] += self._translated(waves[i], place[j] - place[i], float(self.specimen.radius[j]))
        return out

    def _translated(self, waves: np.ndarray, by: np.ndarray, radius: float) -> np.ndarray:
        """Outgoing waves around one point as regular waves around another: turned, led along z, turned back."""
        distance = float(np.linalg.norm(by))
        beta, angle = math.acos(float(np.clip(by[2] / distance, -1.0, 1.0))), math.atan2(by[1], by[0])
        turns = self._wigner(beta)
        phase = np.exp(1j * self.m * angle)[:, None, None]
        turned = self._turn(waves * phase, turns, back=True)
        same, other = self._axial(distance, radius)
        led = np.empty_like(turned)
        for m in range(-self.highest, self.highest + 1):
            size = abs(m)
            rows = np.flatnonzero(self.m == m)
            a, b = same[size], (other[size] if m >= 0 else -other[size])
            led[rows, 0] = a @ turned[rows, 0] + b @ turned[rows, 1]
            led[rows, 1] = b @ turned[rows, 0] + a @ turned[rows, 1]
        return self._turn(led, turns, back=False) * phase.conj()

    def _turn(self, waves: np.ndarray, turns: list[np.ndarray], *, back: bool) -> np.ndarray:
        out = np.empty_like(waves)
        for n in range(1, self.highest + 1):
            rows = slice(n * n - 1, n * n + 2 * n)
            d = turns[n].T if back else turns[n]
            out[rows] = np.tensordot(d, waves[rows], 1)
        return out

    def _wigner(self, beta: float) -> list[np.ndarray]:
        key = round(beta, 12)
        if key not in self._turns:
            self._turns[key] = [wigner(n, beta) if n else np.ones((1, 1)) for n in range(self.highest + 1)]
        return self._turns[key]

    def _axial(self, distance: float, radius: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
        key = (round(distance, 9), round(radius, 9))
        if key not in self._steps:
            self._steps[key] = axial_translation(self.highest, self.k * distance, self.k * radius)
        return self._steps[key]

    def far_field(self, waves: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """(w, p, 2) amplitudes f along θ̂ and φ̂, the field being f e^{ikr}/r at a distance r from the origin [µm].

        Args:
            waves: Of `scattered`.
            direction: (p, 3) unit vectors.
        """
        cosine, angle = direction[:, 2], np.arctan2(direction[:, 1], direction[:, 0])
        psi = tangential(self.highest, cosine, angle)
        phi = np.stack([-psi[:, 1], psi[:, 0]], axis=1)
        power = (-1j) ** self.n
        basis = np.concatenate([phi * (power * -1j)[:, None, None], psi * power[:, None, None]])
        basis = basis.reshape(2 * len(self.n), -1).astype(np.complex64)
        out = np.zeros((waves.shape[-1], len(direction), 2), dtype=np.complex64)
        for place, own in zip(self.specimen.start, waves, strict=True):
            both = np.concatenate([own[:, 0], own[:, 1]]).astype(np.complex64)
            field = (both.T @ basis).reshape(-1, 2, len(direction)).swapaxes(1, 2)
            out += field * np.exp(-1j * self.k * direction @ place).astype(np.complex64)[None, :, None]
        return out / self.k


def plane_wave(highest: int, direction: np.ndarray, polarisation: np.ndarray) -> np.ndarray:
    """(orders, 2, w) regular waves M and N around the origin that make up plane waves."""
    angle = np.arctan2(direction[:, 1], direction[:, 0])
    along, across = frame(direction)
    psi = tangential(highest, direction[:, 2], angle).conj()
    e = np.stack([np.sum(polarisation * along, axis=1), np.sum(polarisation * across, axis=1)])
    n, _ = orders(highest)
    factor = (4.0 * math.pi * 1j**n)[:, None]
    magnetic = factor * (-psi[:, 1] * e[0] + psi[:, 0] * e[1])
    electric = -1j * factor * (psi[:, 0] * e[0] + psi[:, 1] * e[1])
    return np.stack([magnetic, electric], axis=1)


def frame(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """θ̂ and φ̂ of unit vectors, each (w, 3)."""
    angle = np.arctan2(direction[:, 1], direction[:, 0])
    sine = np.sqrt(np.maximum(0.0, 1.0 - direction[:, 2] ** 2))
    along = np.stack([direction[:, 2] * np.cos(angle), direction[:, 2] * np.sin(angle), -sine], axis=1)
    return along, np.stack([-np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=1)


def axial_translation(highest: int, distance: float, radius: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Outgoing waves around the origin as regular waves around a point at `distance` up the z axis.

    The field of each outgoing wave and its curl are projected on the regular waves over a sphere around that point, by
    Gauss–Legendre quadrature; what radial and tangential parts say is weighed by how large they are, so that no zero of
    a Bessel function matters.

    Args:
        highest: Order of both expansions.
        distance: Times the wavenumber.
        radius: Of the sphere, times the wavenumber; less than `distance`.

    Returns:
        Per m ≥ 0, (orders, orders) from M to M (and N to N), and from M to N (and N to M); the latter change their sign
        with m. Rows and columns are n = max(1, m) … highest.
    """
    nodes, weights = np.polynomial.legendre.leggauss(4 * highest + 60)
    sine = np.sqrt(1.0 - nodes**2)
    x, z = radius * sine, radius * nodes + distance
    r = np.hypot(x, z)
    there = legendre(highest, z / r)
    here = legendre(highest, nodes)
    h, h_slope = bessel(highest, r, outgoing=True)
    j, j_slope = bessel(highest, np.array(radius), outgoing=False)
    # θ̂ and r̂ there, in terms of those here
    turn_c, turn_s = (z / r) * nodes + (x / r) * sine, (z / r) * sine - (x / r) * nodes
    same, other = [], []
    for m in range(highest + 1):
        n = np.arange(max(1, m), highest + 1)
        root = np.sqrt(n * (n + 1.0))[:, None]
        p, slope, over = (a[n, m] for a in there)
        # outgoing M and N, without exp(imφ): components r, θ, φ there
        magnetic = np.zeros_like(p, dtype=complex), -1j * over / root * h[n], slope / root * h[n]
        electric = root * p * h[n] / r, slope / root * h_slope[n], 1j * over / root * h_slope[n]
        p, slope, over = (2.0 * math.pi * weights * a[n, m] for a in here)
        found = []
        for e_r, e_t, e_f in (magnetic, electric):
            radial = e_r * turn_c + e_t * turn_s
            polar = e_t * turn_c - e_r * turn_s
            on_y = p @ radial.T
            on_psi = (slope / root) @ polar.T + (-1j * over / root) @ e_f.T
            on_phi = (1j * over / root) @ polar.T + (slope / root) @ e_f.T
            found.append((on_y, on_psi, on_phi))
        c_m, c_n, c_y = j[n][:, None], j_slope[n][:, None], root * j[n][:, None] / radius
        whole = c_m**2 + c_n**2 + c_y**2
        (y1, psi1, phi1), (y2, psi2, phi2) = found
        # the curl of a wave that is α M + β N is −k (α N + β M)
        same.append((c_m * phi1 + c_n * psi2 + c_y * y2) / whole)
        other.append((c_m * phi2 + c_n * psi1 + c_y * y1) / whole)
    return same, other
