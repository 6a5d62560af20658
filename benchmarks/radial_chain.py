"""What an integrator makes of a bead in a trap of one curve for all directions, without Monte-Carlo noise.

As `transitions`, in three dimensions: one time step as an operator on functions of the distance, the expectation over
the noise by quadrature. Functions are polynomials between points that crowd where the force bends or ends, because
what a step makes of a function bends within the thermal displacement of a step from there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from otwarp.bench.radial_wells import Averages, RadialWell, solution, steps_in

ORDER = 10
"""Nodes of each polynomial."""

ALONG, ACROSS, WIDEST = 161, 10, 7.0
"""Points of the noise along the way from the centre, up to so many standard deviations, and across it."""

CROWD = (0.5, 1.0, 2.0, 3.5, 6.0, 9.0, 13.0)
"""Thermal displacements of a step from where a force bends or ends to the ends of polynomials."""

LEAST = 0.12
"""Of a thermal displacement: the shortest polynomial."""


@dataclass(frozen=True, eq=False)
class RadialChain:
    """The chain that an integrator makes of a well.

    Attributes:
        integrator: `eulerMaruyama`, `heun` or `exponential`.
        well: Where the bead is.
        step: h, the time step over γ/k.
    """

    integrator: str
    well: RadialWell
    step: float

    @cached_property
    def edges(self) -> np.ndarray:
        """Ends of the polynomials, from the centre to the end of the well."""
        end, spread = self.well.end, math.sqrt(2.0 * self.step)
        fixed = {0.0, self.well.bend, end}
        near = {p + s * m * spread for p in (self.well.bend, end) for m in CROWD for s in (-1.0, 1.0)}
        near |= set(np.linspace(0.0, end, 9))
        kept = sorted(fixed)
        for point in sorted(near):
            if 0.0 < point < end and min(abs(point - k) for k in kept) > LEAST * spread:
                kept.append(point)
        return np.array(sorted(kept))

    @cached_property
    def _nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """(p,) Chebyshev nodes in (−1, 1) and their barycentric weights."""
        turn = (2.0 * np.arange(ORDER) + 1.0) * math.pi / (2.0 * ORDER)
        return np.cos(turn), (-1.0) ** np.arange(ORDER) * np.sin(turn)

    @cached_property
    def x(self) -> np.ndarray:
        """(n,) nodes of all polynomials."""
        low, high = self.edges[:-1, None], self.edges[1:, None]
        return (0.5 * (low + high) + 0.5 * (high - low) * self._nodes[0]).ravel()

    @cached_property
    def _kicks(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(q,) σΔW along and across the way from the centre, and weights."""
        along = np.linspace(-WIDEST, WIDEST, ALONG)
        energy, share = np.polynomial.laguerre.laggauss(ACROSS)
        one, other = np.meshgrid(along, np.sqrt(2.0 * energy), indexing="ij")
        weight = np.outer(np.exp(-0.5 * along**2), share).ravel()
        seen = weight > 1e-13 * weight.max()
        spread = math.sqrt(2.0 * self.step)
        return spread * one.ravel()[seen], spread * other.ravel()[seen], weight[seen] / weight[seen].sum()

    def _drift(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement by the force in one step at u along and v across."""
        r = np.hypot(u, v)
        pull = -self.step * self.well.force(r) / np.maximum(r, 1e-300)
        return pull * u, pull * v

    @cached_property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, q) where the step leads from each node, along and across, as the kernels take it."""
        x, h = self.x[:, None], self.step
        along, across = (kick[None, :] for kick in self._kicks[:2])
        first = -h * self.well.force(x)
        if self.integrator == "eulerMaruyama":
            return x + first + along, across + 0.0 * x
        if self.integrator == "heun":
            du, dv = self._drift(x + first + along, across + 0.0 * x)
            return x + along + 0.5 * (first + du), across + 0.5 * dv
        assert self.integrator == "exponential", self.integrator
        steep, round_about = h * self.well.slope(x), h * self.well.force(x) / x
        u = _series(steep, -1 / 2, 1 / 6, -1 / 24) * first + _series(steep, -1 / 2, 5 / 24, -1 / 16) * along
        v = _series(round_about, -1 / 2, 5 / 24, -1 / 16) * across
        du, dv = self._drift(x + u, v)
        u = x + u + 0.5 * _series(steep, -1 / 3, 1 / 12, -1 / 60) * (du - first + steep * u)
        return u, v + 0.5 * _series(round_about, -1 / 3, 1 / 12, -1 / 60) * (dv + round_about * v)

    @cached_property
    def distance(self) -> np.ndarray:
        """(n, q) of these places from the centre."""
        return np.hypot(*self.ends)

    @cached_property
    def kept(self) -> np.ndarray:
        """(n, q) probability that the bead has not left on its way, as in `kernels.optics.escapes`."""
        before, after = self.well.end - self.x[:, None], self.well.end - self.distance
        return np.where(after > 0.0, -np.expm1(-before * np.maximum(after, 0.0) / self.step), 0.0)

    def _operator(self, factor: np.ndarray) -> np.ndarray:
        """(n, n) g ↦ E factor g(end), with values at the nodes → values at the nodes."""
        nodes, barycentric = self._nodes
        r, n = np.minimum(self.distance, self.well.end), len(self.x)
        piece = np.clip(np.searchsorted(self.edges, r, side="right") - 1, 0, len(self.edges) - 2)
        low, high = self.edges[piece], self.edges[piece + 1]
        apart = (2.0 * (r - low) / (high - low) - 1.0)[..., None] - nodes
        # on a node the others do not count
        apart = np.where(np.abs(apart) < 1e-14, 1e-14, apart)
        share = barycentric / apart
        share *= (factor * self._kicks[2] / share.sum(axis=-1))[..., None]
        rows = n * np.repeat(np.arange(n), r.shape[1])
        flat = sum(
            np.bincount(rows + (ORDER * piece + p).ravel(), weights=share[..., p].ravel(), minlength=n * n)
            for p in range(ORDER)
        )
        return np.asarray(flat).reshape(n, n)

    def _at(self, values: np.ndarray, r: float) -> float:
        """A function at a distance."""
        nodes, barycentric = self._nodes
        piece = int(np.clip(np.searchsorted(self.edges, r, side="right") - 1, 0, len(self.edges) - 2))
        low, high = self.edges[piece : piece + 2]
        share = barycentric / (2.0 * (r - low) / (high - low) - 1.0 - nodes)
        return float(share @ values[ORDER * piece : ORDER * (piece + 1)] / share.sum())

    @cached_property
    def stay(self) -> np.ndarray:
        """(n, n) g ↦ E g(end) over the beads that are still there after a step."""
        return self._operator(self.kept)

    def still(self, steps: int) -> np.ndarray:
        """(n,) share of beads that are still there after some steps."""
        return np.linalg.matrix_power(self.stay, steps) @ np.ones(len(self.x))

    def survival(self, start: float, steps: int) -> float:
        """That of beads that start at `start` of the way to the end."""
        return self._at(self.still(steps), start * self.well.end)

    def averages(self) -> Averages:
        """What a run would show, at the times of `Solution.averages`."""
        stay = self.stay
        turned = self._operator(self.kept * self.ends[0] / np.maximum(self.distance, 1e-300))
        values, vectors = (np.real(found) for found in np.linalg.eig(stay.T))
        best = int(np.argmax(values))
        share, loss = vectors[:, best], float(values[best])
        share = share / share.sum()
        variance = float(share @ self.x**2) / 3.0
        steps = steps_in(solution(self.well.shape, self.well.depth).forgetting, self.step)
        later, correlations = self.x, []
        for n in range(1, max(steps, 5) + 1):
            later = turned @ later
            correlations.append(float((share * self.x) @ later) / 3.0 / loss**n)
        moved = [
            variance + float((share * self.still(n)) @ self.x**2) / 3.0 / loss**n - 2.0 * correlations[n - 1]
            for n in (1, 5)
        ]
        waiting = np.linalg.solve(np.eye(len(self.x)) - stay, np.ones(len(self.x)))
        return Averages(
            variance=variance,
            correlation=correlations[steps - 1] / variance,
            displacement=moved[0],
            displacements=moved[1],
            # an escape counts for the middle of its step
            escape=self.step * (self._at(waiting, 0.0) - 0.5),
        )


def _series(z: np.ndarray, first: float, second: float, third: float) -> np.ndarray:
    """1 + first·z + second·z² + third·z³."""
    return 1.0 + z * (first + z * (second + z * third))
