"""Exact optical force and torque on a sphere: generalised Lorenz–Mie theory by one-dimensional quadrature.

The beam seen from the sphere's centre r₀ is its angular spectrum times exp(ik s·r₀). In cylindrical coordinates of r₀
the azimuthal integral of each multipole coefficient is a Bessel function, and the polar one is done by Gauss–Legendre
quadrature; no translation matrices. The sphere changes the coefficients by its Mie coefficients, and force and torque
are what linear and angular momentum the outgoing wave lacks (Gouesbet, Maheu, Gréhan 1988,
doi:10.1364/JOSAA.5.001427; Farsund, Felderhof 1996, doi:10.1016/0378-4371(96)00009-X for the momentum balance).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from otwarp.errors import InputError
from otwarp.optics.beam import Beam
from otwarp.optics.harmonics import across_axis, along_axis, bessel_j, gauss_legendre, raise_m, wigner_d
from otwarp.optics.mie import Particle, highest_order, mie_coefficients

LARGEST_SIZE = 250.0
"""Size parameter k·r up to which the recurrences were tested."""

FARTHEST = 2e4
"""Distance from the focus times k up to which forces are evaluated: time and memory grow with it, 2.5 mm in water."""

BATCH_BYTES = 64e6
"""Memory for the coefficients of one batch of points."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Evaluation:
    """Optical action on a sphere at a set of points.

    Attributes:
        force: (n, 3) Q: the force is `beam.force_scale`·Q.
        torque: (n, 3) about the sphere's centre in units of P/ω.
        absorbed: (n,) absorbed over incident power.
        error: Estimated largest absolute error of Q: its change with more multipoles and nodes.
    """

    force: np.ndarray
    torque: np.ndarray
    absorbed: np.ndarray
    error: float


def checked_points(beam: Beam, sphere: Particle, points: np.ndarray) -> tuple[np.ndarray, int]:
    """Points as a float array (n, 3), and the highest multipole order that the sphere scatters.

    Raises:
        InputError: Points of the wrong shape, not finite or too far away, or a sphere too large to converge.
    """
    size = beam.wavenumber * sphere.radius
    if size > LARGEST_SIZE:
        limit = LARGEST_SIZE / beam.wavenumber
        raise InputError(f"sphere radius is {sphere.radius:g} µm; allowed: up to {limit:.3g} µm at this wavelength")
    places = np.asarray(points, dtype=float)
    if places.ndim != 2 or places.shape[1] != 3:
        raise InputError(f"points have shape {places.shape}; allowed: (n, 3)")
    if not np.all(np.isfinite(places)):
        row = int(np.argwhere(~np.isfinite(places).all(axis=1))[0, 0])
        raise InputError(f"point {row} is {tuple(places[row].tolist())}; allowed: finite numbers")
    distance = np.linalg.norm(places, axis=1)
    if np.any(distance > FARTHEST / beam.wavenumber):
        row = int(np.argmax(distance))
        limit = FARTHEST / beam.wavenumber
        raise InputError(f"point {row} is {distance[row]:.4g} µm from the focus; allowed: up to {limit:.4g} µm")
    return places, highest_order(size)


def evaluate(beam: Beam, sphere: Particle, points: np.ndarray) -> Evaluation:
    """Force, torque and absorption with an error estimate.

    Args:
        beam: The incident beam.
        sphere: The sphere.
        points: (n, 3) centres of the sphere relative to the focus [µm].

    Raises:
        InputError: Points of the wrong shape, not finite or too far away, or a sphere too large to converge.
    """
    places, orders = checked_points(beam, sphere, points)
    if len(places) == 0:
        return Evaluation(force=np.zeros((0, 3)), torque=np.zeros((0, 3)), absorbed=np.zeros(0), error=0.0)
    extent = beam.wavenumber * np.linalg.norm(places, axis=1)
    result = np.empty((len(places), 7))
    error = 0.0
    # points of similar distance share the number of quadrature nodes, which grows with it
    order_of = np.argsort(extent, kind="stable")
    start = 0
    while start < len(places):
        count = _batch(orders)
        chosen = order_of[start : start + count]
        nodes = quadrature_nodes(orders, float(extent[chosen[-1]]) + beam.aberration)
        result[chosen] = _act(beam, sphere, places[chosen], orders, nodes)
        probe = chosen[[0, len(chosen) // 2, -1]]
        finer = _act(beam, sphere, places[probe], orders + 4, int(1.35 * nodes) + 12)
        error = max(error, float(np.abs(finer[:, :3] - result[probe, :3]).max()))
        start += count
    return Evaluation(force=result[:, :3], torque=result[:, 3:6], absorbed=result[:, 6], error=error)


def _batch(orders: int) -> int:
    """Points of one batch."""
    return max(8, int(BATCH_BYTES / (16 * 8 * (2 * orders + 3) * (orders + 2))))


def quadrature_nodes(orders: int, extent: float) -> int:
    """Quadrature nodes that resolve the multipoles and a phase of `extent`: k·distance and the beam's aberration.

    Rounded up to a geometric sequence, so that few sets of angular functions serve all distances.
    """
    needed = 48 + int(0.7 * (orders + extent))
    return math.ceil(64.0 * 1.12 ** math.ceil(math.log(max(needed, 64) / 64.0) / math.log(1.12)))


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """What does not depend on the point: nodes, weighted amplitudes, angular functions."""

    cosine: np.ndarray
    sine: np.ndarray
    weight: np.ndarray
    angular: dict[tuple[int, int], np.ndarray]
    power: float


@lru_cache(maxsize=6)
def _spectrum(beam: Beam, orders: int, nodes: int) -> _Spectrum:
    x, w = gauss_legendre(nodes)
    t = 0.5 * beam.edge * (x + 1.0)
    w = 0.5 * beam.edge * w
    amplitude = beam.amplitude(t)
    measure = w * np.sin(t)
    # d^n_{−m,−σ} = (−1)^{m−σ} d^n_{mσ}: without a charge one helicity's sums are also those of the other
    angular = {
        (helicity, m): np.ascontiguousarray(wigner_d(orders, m, helicity, np.cos(t)))
        for helicity in ((1,) if beam.charge == 0 else (1, -1))
        for m in range(-orders, orders + 1)
    }
    power = 2.0 * math.pi * float(np.sum(measure * np.abs(amplitude) ** 2))
    return _Spectrum(np.cos(t), np.sin(t), amplitude * measure, angular, power)


def _coefficients(beam: Beam, points: np.ndarray, orders: int, nodes: int) -> np.ndarray:
    """Multipole coefficients of both helicities, (2, 2·orders + 1, points, orders + 1), for incident power 1."""
    spectrum = _spectrum(beam, orders, nodes)
    k = beam.wavenumber
    rho = np.hypot(points[:, 0], points[:, 1])
    phi = np.arctan2(points[:, 1], points[:, 0])
    carrier = np.exp(1j * k * points[:, 2:] * spectrum.cosine) * spectrum.weight
    highest = orders + 1 + abs(beam.charge)
    radial = bessel_j(highest, k * rho[:, None] * spectrum.sine)
    out = np.zeros((2, 2 * orders + 1, len(points), orders + 1), dtype=complex)
    scale = 2.0 * math.pi / math.sqrt(spectrum.power)
    right, left = beam.helicities()
    amplitudes: dict[int, complex] = {1: right, -1: left}

    def put(helicity: int, m: int, value: np.ndarray) -> None:
        """Give the sum of one order the phase of its azimuthal integral: i^j J_j, where J_{−j} = (−1)^j J_j."""
        if amplitudes[helicity] != 0.0:
            j = m - helicity - beam.charge
            turn = amplitudes[helicity] * scale * (1j ** (abs(j) % 4)) * np.exp(-1j * j * phi)
            out[0 if helicity == 1 else 1, m + orders] = turn[:, None] * value

    products: dict[int, np.ndarray] = {}
    for (helicity, m), table in spectrum.angular.items():
        if beam.charge != 0 and amplitudes[helicity] == 0.0:
            continue
        j = abs(m - helicity - beam.charge)
        if j not in products:
            products[j] = carrier * radial[j]
        # a complex times a real matrix: half the work of promoting the real one
        value = (np.real(products[j]) @ table) + 1j * (np.imag(products[j]) @ table)
        put(helicity, m, value)
        if beam.charge == 0:
            put(-helicity, -m, value if (m - helicity) % 2 == 0 else -value)
    return out


def _act(beam: Beam, sphere: Particle, points: np.ndarray, orders: int, nodes: int) -> np.ndarray:
    """(n, 7): force, torque, absorbed power, by momentum balance between incident and outgoing wave."""
    # multipoles of the sphere couple to incident ones one order higher
    incident = _coefficients(beam, points, orders + 1, nodes)
    size = beam.wavenumber * sphere.radius
    a, b = mie_coefficients(size, complex(sphere.index) / beam.medium_index, orders)
    electric = np.concatenate([[0.0], a, [0.0]])
    magnetic = np.concatenate([[0.0], b, [0.0]])
    scattered = np.empty_like(incident)
    # the sphere keeps parity, not helicity: electric and magnetic waves are sum and difference of the helicities
    scattered[0] = -(electric + magnetic) * incident[0] + (electric - magnetic) * incident[1]
    scattered[1] = -(electric + magnetic) * incident[1] + (electric - magnetic) * incident[0]
    out = np.zeros((len(points), 7))
    m = np.arange(-orders - 1, orders + 2)[:, None, None]
    for i, helicity in enumerate((1, -1)):
        before, change = incident[i], scattered[i]
        if not np.any(change):
            continue
        both = 2.0 * before + change
        out[:, 2] -= np.real(_overlap(both, along_axis(change, helicity)))
        moved = across_axis(change, helicity)
        sideways = _overlap(before + change, moved) + _overlap(change, across_axis(before, helicity))
        out[:, 0] -= np.real(sideways)
        out[:, 1] -= np.imag(sideways)
        raised = _overlap(before + change, raise_m(change)) + _overlap(change, raise_m(before))
        out[:, 3] -= np.real(raised)
        out[:, 4] -= np.imag(raised)
        density = np.real(np.conj(both) * change)
        out[:, 5] -= np.sum(m * density, axis=(0, 2))
        out[:, 6] -= np.sum(density, axis=(0, 2))
    return out


def _overlap(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Σ conj(left)·right over m and n, per point."""
    return np.einsum("mpn,mpn->p", np.conj(left), right)
