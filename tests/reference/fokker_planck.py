"""Smoluchowski equations by finite volumes in float64: what a swarm of overdamped spheres does, without a sphere.

∂p/∂t = −∇·J, J = D (F/k_B T) p − D ∇p. Fluxes between neighbouring cells are exponentially fitted (Scharfetter & Gummel
1969, doi:10.1109/T-ED.1969.16566), so a conservative force has its Boltzmann distribution to the order of the midpoint
rule, probabilities stay positive, and nothing is lost. The force need not be conservative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_simpson, simpson
from scipy.sparse import csc_matrix, csr_matrix, diags, vstack
from scipy.sparse.linalg import expm_multiply, spsolve

Force = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def bernoulli(x: np.ndarray) -> np.ndarray:
    """x/(eˣ − 1), 1 at 0."""
    small = np.abs(x) < 1e-6
    safe = np.where(small, 1.0, x)
    return np.where(small, 1.0 - 0.5 * x, safe / np.expm1(safe))


@dataclass(frozen=True, eq=False)
class Swarm:
    """Probabilities of cells of an axisymmetric grid, with dm/dt = generator @ m.

    Attributes:
        first, second: (n,) coordinates of the cells' centres.
        volume: (n,) of the cells.
        generator: (n, n), columns sum to zero, or to the loss through an absorbing boundary [1/s].
    """

    first: np.ndarray
    second: np.ndarray
    volume: np.ndarray
    generator: csr_matrix

    def stationary(self) -> np.ndarray:
        """(n,) probabilities that do not change, of sum 1."""
        n = len(self.volume)
        # the equations are dependent: one of them gives way to the sum
        rows = vstack([self.generator[:-1], csr_matrix(np.ones((1, n)))])
        right = np.zeros(n)
        right[-1] = 1.0
        return np.asarray(spsolve(csc_matrix(rows), right))

    def later(self, probability: np.ndarray, time: float) -> np.ndarray:
        """Probabilities `time` [s] after; (n,) or (n, k)."""
        return expm_multiply(self.generator * time, probability)

    def later_mean(self, observable: np.ndarray, time: float) -> np.ndarray:
        """(n,) expectation of an observable `time` after the swarm was in each cell."""
        return expm_multiply(self.generator.T.tocsr() * time, observable)

    def exit_time(self) -> np.ndarray:
        """(n,) mean time to leave through the absorbing boundary from each cell [s]."""
        return np.asarray(spsolve(csc_matrix(self.generator.T), -np.ones(len(self.volume))))


def _couple(
    n: int, left: np.ndarray, right: np.ndarray, conductance: np.ndarray, peclet: np.ndarray, volume: np.ndarray
) -> csr_matrix:
    """Generator of fluxes conductance·[B(−Pe) p_left − B(Pe) p_right] through faces, p = m/volume."""
    out = conductance * bernoulli(-peclet) / volume[left]
    back = conductance * bernoulli(peclet) / volume[right]
    return csr_matrix((out, (right, left)), shape=(n, n)) + csr_matrix((back, (left, right)), shape=(n, n))


def cylinder(force: Force, rho: np.ndarray, z: np.ndarray, *, diffusion: float, energy: float) -> Swarm:
    """A swarm in ρ < rho[-1], z[0] < z < z[-1] between reflecting walls, in a field without azimuth.

    Args:
        force: (ρ, z) → (F_ρ, F_z) [pN], arrays of one shape.
        rho, z: Edges of the cells [µm], rho[0] = 0.
        diffusion: D [µm²/s].
        energy: k_B T [pN·µm].
    """
    rc, zc = 0.5 * (rho[1:] + rho[:-1]), 0.5 * (z[1:] + z[:-1])
    shape = (len(rc), len(zc))
    index = np.arange(rc.size * zc.size).reshape(shape)
    ring = np.pi * (rho[1:] ** 2 - rho[:-1] ** 2)
    volume = (ring[:, None] * np.diff(z)[None, :]).ravel()
    n = volume.size
    r, s = np.meshgrid(rho[1:-1], zc, indexing="ij")
    gap = np.diff(rc)[:, None]
    across = _couple(
        n,
        index[:-1].ravel(),
        index[1:].ravel(),
        (diffusion * 2.0 * np.pi * r * np.diff(z)[None, :] / gap).ravel(),
        (force(r.ravel(), s.ravel())[0].reshape(r.shape) * gap / energy).ravel(),
        volume,
    )
    r, s = np.meshgrid(rc, z[1:-1], indexing="ij")
    gap = np.diff(zc)[None, :]
    along = _couple(
        n,
        index[:, :-1].ravel(),
        index[:, 1:].ravel(),
        (diffusion * ring[:, None] / gap * np.ones_like(s)).ravel(),
        (force(r.ravel(), s.ravel())[1].reshape(r.shape) * gap / energy).ravel(),
        volume,
    )
    jumps = across + along
    generator = csr_matrix(jumps - diags(np.asarray(jumps.sum(axis=0)).ravel()))
    where = np.meshgrid(rc, zc, indexing="ij")
    return Swarm(where[0].ravel(), where[1].ravel(), volume, generator)


def ball(
    potential: Callable[[np.ndarray, np.ndarray], np.ndarray],
    radius: float,
    *,
    shells: int,
    sectors: int,
    diffusion: float,
    energy: float,
) -> Swarm:
    """A swarm in a ball whose surface absorbs, in a potential that depends on r and μ = cos θ.

    Args:
        potential: (r, μ) → U [pN·µm].
        radius: Of the ball [µm].
        shells, sectors: Cells along r and μ.
    """
    r, mu = np.linspace(0.0, radius, shells + 1), np.linspace(-1.0, 1.0, sectors + 1)
    rc, mc = 0.5 * (r[1:] + r[:-1]), 0.5 * (mu[1:] + mu[:-1])
    index = np.arange(shells * sectors).reshape(shells, sectors)
    shell, dmu = (r[1:] ** 3 - r[:-1] ** 3) / 3.0, 2.0 / sectors
    volume = 2.0 * np.pi * dmu * np.repeat(shell, sectors)
    at = np.meshgrid(rc, mc, indexing="ij")
    u = potential(*at) / energy
    n = volume.size
    conductance = 2.0 * np.pi * dmu * diffusion * r[1:-1] ** 2 / np.diff(rc)
    radial = _couple(
        n,
        index[:-1].ravel(),
        index[1:].ravel(),
        np.repeat(conductance, sectors),
        (u[:-1] - u[1:]).ravel(),
        volume,
    )
    # ∂/∂μ (1 − μ²) ∂p/∂μ per r² of the volume: the thickness of the shell remains
    around = (np.diff(r)[:, None] * 2.0 * np.pi * diffusion * (1.0 - mu[1:-1] ** 2)[None, :] / dmu).ravel()
    polar = _couple(n, index[:, :-1].ravel(), index[:, 1:].ravel(), around, (u[:, :-1] - u[:, 1:]).ravel(), volume)
    jumps = radial + polar
    lost = np.asarray(jumps.sum(axis=0)).ravel()
    # from the last centres to the surface, half a cell away
    half = radius - rc[-1]
    edge = potential(np.full(sectors, radius), mc) / energy
    rim = 2.0 * np.pi * dmu * diffusion * radius**2 / half * bernoulli(edge - u[-1])
    lost[index[-1]] += rim / volume[index[-1]]
    generator = csr_matrix(jumps - diags(lost))
    return Swarm(at[0].ravel(), at[1].ravel(), volume, generator)


def mean_first_passage(
    potential: Callable[[np.ndarray], np.ndarray], radius: float, *, diffusion: float, energy: float
) -> float:
    """Mean time to diffuse from the centre of a radially symmetric well to `radius` [s].

    T = (1/D) ∫₀^R dr r⁻² e^(U/k_B T) ∫₀^r ds s² e^(−U/k_B T) (Gardiner 2009, Stochastic Methods, §5.5;
    Pontryagin, Andronov & Vitt 1933), by Simpson's rule on 4000 intervals.
    """
    r = np.linspace(0.0, radius, 4001)
    u = potential(r) / energy
    inner = cumulative_simpson(r**2 * np.exp(-u), x=r, initial=0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        outer = np.where(r > 0.0, np.exp(u) * inner / r**2, 0.0)
    return float(simpson(outer, x=r)) / diffusion
