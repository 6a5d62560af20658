"""What one bead in one trap does on average, without Monte-Carlo noise: the Smoluchowski equation in float64.

∂p/∂t = −∇·(D (F/k_B T) p − D ∇p) in a ball about the equilibrium, for a force without azimuth: finite volumes in
(r, θ) with exponentially fitted fluxes (Scharfetter & Gummel 1969, doi:10.1109/T-ED.1969.16566), so that probabilities
stay positive and nothing is lost. The force need not be conservative. Averages come from the stationary probabilities,
correlations from the adjoint equation ∂g/∂t = L†g, mean escape times from L†T = −1 (Pontryagin, Andronov & Vitt 1933;
Gardiner 2009, Stochastic Methods, section 5.5).

All errors are of second order in the cell, so two grids give both a better value (Richardson) and its error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import SuperLU, splu

Force = Callable[[np.ndarray], np.ndarray]
"""(n, 3) points from the ball's centre [µm], all in the half plane y = 0, x ≥ 0 → (n, 3) forces [pN]."""

SHELLS, SECTORS = 80, 56
"""Cells of the coarse grid along r and θ; the fine one has twice as many of both."""

CROWDING = 2.0
"""How much finer the cells are near the centre: radii of the faces go as sinh(CROWDING·u), u from 0 to 1."""

REFINEMENTS, REFINED = 20, 1e-6
"""Most solutions of one linear system, and the relative change by which one ends them."""

MOMENTS = 64
"""Implicit steps over one lag; their error, of second order, is far below the grid's."""


@dataclass(frozen=True)
class Estimate:
    """A number and how wrong it may be.

    Attributes:
        value: Extrapolated from two grids.
        error: Its distance from the value on the fine grid, a bound where errors are of second order.
    """

    value: float
    error: float

    @classmethod
    def from_grids(cls, coarse: float, fine: float) -> Estimate:
        """Richardson extrapolation for half the cell size."""
        value = (4.0 * fine - coarse) / 3.0
        return cls(value, abs(value - fine))


@dataclass(frozen=True, eq=False)
class Ball:
    """The generator of the motion in a ball on one grid; n cells.

    Attributes:
        force: The force.
        radius: Of the ball [µm].
        diffusion: D [µm²/s].
        energy: k_B T [pN·µm].
        absorbing: Whether the surface takes out whoever reaches it, or reflects.
        shells, sectors: Cells along r and θ.
    """

    force: Force
    radius: float
    diffusion: float
    energy: float
    absorbing: bool = False
    shells: int = SHELLS
    sectors: int = SECTORS

    @cached_property
    def faces(self) -> tuple[np.ndarray, np.ndarray]:
        """r (shells + 1) [µm] and θ (sectors + 1) of the faces."""
        u = np.linspace(0.0, 1.0, self.shells + 1)
        return self.radius * np.sinh(CROWDING * u) / np.sinh(CROWDING), np.linspace(0.0, np.pi, self.sectors + 1)

    @cached_property
    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) r [µm] and θ of the cells, θ running fastest."""
        r, theta = (0.5 * (edges[1:] + edges[:-1]) for edges in self.faces)
        across, around = np.meshgrid(r, theta, indexing="ij")
        return across.ravel(), around.ravel()

    @cached_property
    def volume(self) -> np.ndarray:
        """(n,) of the cells [µm³]."""
        r, theta = self.faces
        return 2.0 * np.pi * np.outer(np.diff(r**3) / 3.0, -np.diff(np.cos(theta))).ravel()

    @property
    def rho(self) -> np.ndarray:
        """(n,) distance from the axis [µm]."""
        r, theta = self.centres
        return r * np.sin(theta)

    @property
    def z(self) -> np.ndarray:
        """(n,) height above the centre [µm]."""
        r, theta = self.centres
        return r * np.cos(theta)

    def _pull(self, r: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """F_r, F_θ, F_φ over k_B T [1/µm] at any (r, θ) of one shape."""
        sine, cosine = np.sin(theta), np.cos(theta)
        points = np.stack([r * sine, np.zeros_like(r), r * cosine], axis=-1)
        f = self.force(points.reshape(-1, 3)).reshape(points.shape) / self.energy
        return f[..., 0] * sine + f[..., 2] * cosine, f[..., 0] * cosine - f[..., 2] * sine, f[..., 1]

    @cached_property
    def jumps(self) -> coo_matrix:
        """(n, n) rates of going from one cell to another [1/s]."""
        index = np.arange(self.shells * self.sectors).reshape(self.shells, self.sectors)
        return coo_matrix(self._radial(index) + self._polar(index))

    @cached_property
    def leaving(self) -> np.ndarray:
        """(n,) rate of leaving through the surface [1/s]."""
        out = np.zeros(self.shells * self.sectors)
        if self.absorbing:
            out[-self.sectors :] = self._through_surface() / self.volume[-self.sectors :]
        return out

    @cached_property
    def adjoint(self) -> csc_matrix:
        """(n, n) L†: (L†g)_i = Σ_j rate_ij (g_j − g_i), less the rate of leaving through the surface [1/s]."""
        loss = np.asarray(self.jumps.sum(axis=1)).ravel() + self.leaving
        return csc_matrix(self.jumps - diags(loss))

    def _radial(self, index: np.ndarray) -> csc_matrix:
        """Jumps between shells."""
        (r, theta), rc = self.faces, self.centres[0].reshape(index.shape)[:, 0]
        middle = 0.5 * (theta[1:] + theta[:-1])
        gap = np.diff(rc)[:, None]
        at, around = np.meshgrid(r[1:-1], middle, indexing="ij")
        area = 2.0 * np.pi * np.outer(r[1:-1] ** 2, -np.diff(np.cos(theta)))
        peclet = self._pull(at, around)[0] * gap
        return self._jumps(index[:-1], index[1:], self.diffusion * area / gap, peclet)

    def _polar(self, index: np.ndarray) -> csc_matrix:
        """Jumps within a shell."""
        (r, theta), rc = self.faces, self.centres[0].reshape(index.shape)[:, 0]
        gap = (rc * (theta[1] - theta[0]))[:, None]
        at, around = np.meshgrid(rc, theta[1:-1], indexing="ij")
        area = np.pi * np.outer(np.diff(r**2), np.sin(theta[1:-1]))
        peclet = self._pull(at, around)[1] * gap
        return self._jumps(index[:, :-1], index[:, 1:], self.diffusion * area / gap, peclet)

    def _through_surface(self) -> np.ndarray:
        """(sectors,) volume that leaves per second of a cell of unit concentration [µm³/s]."""
        theta, rc = self.faces[1], self.centres[0][-1]
        half, middle = self.radius - rc, 0.5 * (theta[1:] + theta[:-1])
        area = -2.0 * np.pi * self.radius**2 * np.diff(np.cos(theta))
        peclet = self._pull(np.full_like(middle, 0.5 * (self.radius + rc)), middle)[0] * half
        return self.diffusion * area / half * bernoulli(-peclet)

    def _jumps(self, one: np.ndarray, other: np.ndarray, conductance: np.ndarray, peclet: np.ndarray) -> csc_matrix:
        """Rates of both directions through faces with these conductances [µm³/s] and Péclet numbers of the gap."""
        n = self.shells * self.sectors
        left, right = one.ravel(), other.ravel()
        out = (conductance * bernoulli(-peclet)).ravel() / self.volume[left]
        back = (conductance * bernoulli(peclet)).ravel() / self.volume[right]
        rows, columns = np.concatenate([left, right]), np.concatenate([right, left])
        return csc_matrix((np.concatenate([out, back]), (rows, columns)), shape=(n, n))

    @cached_property
    def stationary(self) -> np.ndarray:
        """(n,) probabilities of the cells that do not change; the surface must reflect."""
        assert not self.absorbing, "nothing is stationary where probability is lost"
        flow = self.adjoint.T.tolil()
        # the equations are dependent: the first gives way to fixing its own unknown, in the middle of the well
        flow[0, :] = 0.0
        flow[0, 0] = 1.0
        right = np.zeros(len(self.volume))
        right[0] = 1.0
        found = splu(csc_matrix(flow)).solve(right)
        return found / found.sum()

    def exit_time(self) -> float:
        """Mean time from the centre to the absorbing surface [s].

        Out of a well 30 k_B T deep the times of neighbouring cells differ in the thirteenth digit, so that the matrix
        alone leaves three. What is missing of −1 is therefore taken from differences of times, with the digits of
        `numpy.longdouble`, and solved for again (iterative refinement, Moler 1967, doi:10.1145/321386.321394).
        """
        solver = splu(self.adjoint)
        at, to = self.jumps.row, self.jumps.col
        time = np.zeros(len(self.volume), np.longdouble)
        for _ in range(REFINEMENTS):
            gained = -1.0 + self.leaving * time
            np.add.at(gained, at, self.jumps.data * (time[at] - time[to]))
            change = solver.solve(np.asarray(gained, float))
            time += change
            if np.abs(change).max() <= REFINED * np.abs(time).max():
                break
        return float(np.average(time[: self.sectors], weights=self.volume[: self.sectors]))

    def survival(self, time: float) -> np.ndarray:
        """(n,) probability that who starts in each cell has not reached the absorbing surface by `time` [s]."""
        return advance(self.adjoint, np.ones(len(self.volume)), time)

    def moments(self) -> tuple[float, float]:
        """⟨x² + y²⟩ and the variance of z [µm²]."""
        p, z = self.stationary, self.z
        return float(p @ self.rho**2), float(p @ z**2 - (p @ z) ** 2)

    def correlation_x(self, lag: float) -> float:
        """⟨x(0) x(t)⟩/⟨x²⟩.

        x is the real part of ρ e^{iφ}, so its mean a time t later is that of g(r, θ) e^{iφ}, and L† acts on g with
        −D/ρ² for the second derivative along φ and (D/k_B T) i F_φ/ρ for the drift there.
        """
        around = self._pull(*self.centres)[2] / self.rho
        rate = -self.diffusion / self.rho**2 + 1j * self.diffusion * around
        later = advance(csc_matrix(self.adjoint + diags(rate)), self.rho.astype(complex), lag)
        weight = self.stationary * self.rho
        return float(np.real(weight @ later) / (weight @ self.rho))

    def correlation_z(self, lag: float) -> float:
        """Normalised autocorrelation ⟨δz(0) δz(t)⟩/⟨δz²⟩ of the place along the axis."""
        p = self.stationary
        away = self.z - p @ self.z
        return float((p * away) @ advance(self.adjoint, away, lag) / (p @ away**2))


def bernoulli(x: np.ndarray) -> np.ndarray:
    """x/(eˣ − 1), 1 at 0."""
    small = np.abs(x) < 1e-6
    safe = np.where(small, 1.0, np.clip(x, -600.0, 600.0))
    return np.where(small, 1.0 - 0.5 * x, safe / np.expm1(safe))


def advance(adjoint: csc_matrix, start: np.ndarray, time: float, moments: int = MOMENTS) -> np.ndarray:
    """exp(L† t) g by TR-BDF2 (Bank et al. 1985, doi:10.1109/T-ED.1985.22232): second order, and stiff modes die out.

    Args:
        adjoint: L† [1/s].
        start: (n,) g at time 0.
        time: t [s].
        moments: Steps.
    """
    step, part = time / moments, 2.0 - np.sqrt(2.0)
    identity = diags(np.ones(len(start)))
    # both stages share one matrix
    solver: SuperLU = splu(csc_matrix(identity - 0.5 * part * step * adjoint))
    g = start
    for _ in range(moments):
        middle = solver.solve(g + 0.5 * part * step * (adjoint @ g))
        g = solver.solve((middle - (1.0 - part) ** 2 * g) / (part * (2.0 - part)))
    return g


@dataclass(frozen=True, kw_only=True)
class Lags:
    """Times between the two positions of a correlation [s].

    Attributes:
        across: For x.
        half, along: For z, about half and one of its relaxation times.
    """

    across: float
    half: float
    along: float


def stationary_averages(
    force: Force,
    radius: float,
    lags: Lags,
    *,
    diffusion: float,
    energy: float,
    shells: int = SHELLS,
    sectors: int = SECTORS,
) -> dict[str, Estimate]:
    """What a bead in a trap does on average, in a ball whose surface reflects, on two grids.

    Args:
        force: The force.
        radius: Of the ball [µm].
        lags: Of the correlations.
        diffusion: D [µm²/s].
        energy: k_B T [pN·µm].
        shells, sectors: Of the coarse grid.

    Returns:
        `rho2` and `z2`, ⟨x² + y²⟩ and the variance of z [µm²]; `x_later`, `z_half_later`, `z_later`, the normalised
        autocorrelations at the lags.
    """
    found: list[tuple[float, ...]] = []
    for scale in (1, 2):
        ball = Ball(force, radius, diffusion, energy, shells=scale * shells, sectors=scale * sectors)
        later = (ball.correlation_x(lags.across), ball.correlation_z(lags.half), ball.correlation_z(lags.along))
        found.append((*ball.moments(), *later))
    names = ("rho2", "z2", "x_later", "z_half_later", "z_later")
    return {name: Estimate.from_grids(*pair) for name, *pair in zip(names, *found, strict=True)}


def mean_exit_time(
    force: Force, radius: float, *, diffusion: float, energy: float, shells: int = SHELLS, sectors: int = SECTORS
) -> Estimate:
    """Mean time from the centre of a ball to its surface [s], on two grids; arguments as `stationary_averages`."""
    times = []
    for scale in (1, 2):
        ball = Ball(force, radius, diffusion, energy, absorbing=True, shells=scale * shells, sectors=scale * sectors)
        times.append(ball.exit_time())
    return Estimate.from_grids(*times)


def survival_probability(
    force: Force,
    radius: float,
    starts: np.ndarray,
    time: float,
    *,
    diffusion: float,
    energy: float,
    shells: int = SHELLS,
    sectors: int = SECTORS,
) -> list[Estimate]:
    """Probability that a bead has not reached the surface of a ball by `time` [s], on two grids.

    Args:
        force: The force.
        radius: Of the ball [µm].
        starts: (n) distances from the centre [µm], at right angles to the beam.
        time: When [s].
        diffusion: D [µm²/s].
        energy: k_B T [pN·µm].
        shells, sectors: Of the coarse grid.
    """
    found = []
    for scale in (1, 2):
        ball = Ball(force, radius, diffusion, energy, absorbing=True, shells=scale * shells, sectors=scale * sectors)
        cells = ball.survival(time).reshape(ball.shells, ball.sectors)
        middle = 0.5 * (cells[:, (ball.sectors - 1) // 2] + cells[:, ball.sectors // 2])
        r = ball.centres[0].reshape(cells.shape)[:, 0]
        # even about the centre, and nothing at the surface
        found.append(CubicSpline(np.concatenate([-r[::-1], r, [radius]])[len(r) - 2 :],
                                 np.concatenate([middle[::-1], middle, [0.0]])[len(r) - 2 :])(starts))  # fmt: skip
    return [Estimate.from_grids(*pair) for pair in zip(*found, strict=True)]
