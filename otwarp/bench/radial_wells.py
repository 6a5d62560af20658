"""A bead in a trap of one curve for all directions: what it does, by the Smoluchowski equation in float64.

Forces are functions of the distance, so averages of scalars and of vectors each obey an equation in r alone. Finite
volumes with the exact resistance and probability of every cell make a symmetric tridiagonal matrix, whose modes give
everything at once: how long a bead stays, and for those that are still there (the quasi-stationary distribution) the
variance, correlations and displacements.

Lengths are in √(k_B T/k), times in γ/k, energies in k_B T; k is the stiffness at the bottom.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.optimize import brentq

from otwarp.bench.closed_forms import drag
from otwarp.bench.scenes import PLACE, bead, scene
from otwarp.laws import TrapLaw
from otwarp.scene import Medium, Scene, Settings, Track, Trap
from otwarp.units import BOLTZMANN

CELLS = 1200
"""Of the finite volumes."""

TEMPERATURE = 298.15
"""Of the scenes [K]."""


def _curve(ratio: float, after: float, end: float) -> TrapLaw:
    """A spring of 1 pN/µm up to 0.1 µm, then A/d² + C up to `end` [µm].

    Args:
        ratio: Slope with which the branch begins to fall, over that of the spring.
        after: Force with which it begins, over that with which the spring ends.
    """
    square = 0.5 * ratio * 0.1**3
    return TrapLaw(
        stiffness=1.0, threshold=0.1, inverse_square=square, offset=0.1 * after - square / 0.1**2, cutoff=end, power=1.0
    )


SHAPES: dict[str, TrapLaw] = {
    "spring with an end": TrapLaw(stiffness=1.0, cutoff=0.1, power=1.0),
    "the paper's radial law": TrapLaw(
        stiffness=12000.0, threshold=0.08, inverse_square=16.18, offset=-1568.0, cutoff=0.1, power=1.0
    ),
    "ten times as steep": _curve(10.0, 1.0, 0.05 * 5.0**0.5),
    "1/d² up to 2δ": _curve(2.0, 1.0, 0.2),
    "jump down to a half": _curve(2.0, 0.5, 0.1 * 2.0**0.5),
    "jump up by a half": _curve(2.0, 1.5, 0.16),
}
"""Shapes of force curves; depths are set by the power."""


@dataclass(frozen=True)
class RadialWell:
    """A trap of one shape and depth.

    Attributes:
        shape: Of `SHAPES`.
        depth: Energy at the end of the law [k_B T].
    """

    shape: str
    depth: float

    @cached_property
    def constants(self) -> tuple[float, float, float, float]:
        """(δ, A, C, end) in thermal units; δ is the end where there is no branch."""
        law = SHAPES[self.shape]
        scale = math.sqrt(self.depth * law.stiffness / self._raw_energy)
        force = scale / law.stiffness
        start = min(law.threshold, law.cutoff)
        return scale * start, law.inverse_square * force * scale**2, law.offset * force, scale * law.cutoff

    @cached_property
    def _raw_energy(self) -> float:
        """Energy at the end with the shape's own power [pN·µm]."""
        law = SHAPES[self.shape]
        start = min(law.threshold, law.cutoff)
        branch = law.inverse_square * (1.0 / start - 1.0 / law.cutoff) + law.offset * (law.cutoff - start)
        return 0.5 * law.stiffness * start**2 + branch

    @property
    def end(self) -> float:
        """Radius where a bead is lost, in thermal units."""
        return self.constants[3]

    @property
    def bend(self) -> float:
        """Radius where the spring ends, in thermal units."""
        return self.constants[0]

    def force(self, r: np.ndarray) -> np.ndarray:
        """Force towards the centre at radii r, of any shape, in thermal units."""
        start, square, offset, end = self.constants
        return np.where(r < start, r, np.where(r < end, square / np.maximum(r, start) ** 2 + offset, 0.0))

    def slope(self, r: np.ndarray) -> np.ndarray:
        """Derivative of the force by the radius."""
        start, square, _, end = self.constants
        return np.where(r < start, 1.0, np.where(r < end, -2.0 * square / np.maximum(r, start) ** 3, 0.0))

    def energy(self, r: np.ndarray) -> np.ndarray:
        """Energy at radii r up to the end, from that of the centre."""
        start, square, offset, _ = self.constants
        beyond = np.maximum(r, start)
        return 0.5 * np.minimum(r, start) ** 2 + square * (1.0 / start - 1.0 / beyond) + offset * (beyond - start)

    @property
    def power(self) -> float:
        """At which the scene's trap has this depth [mW]."""
        return self.depth * BOLTZMANN * TEMPERATURE / self._raw_energy

    @property
    def rate(self) -> float:
        """k/γ of the scene's bead [1/s]."""
        return self.power * SHAPES[self.shape].stiffness / drag(1.0, Medium().viscosity)

    def scene(self, start: float = 0.0, **settings: Any) -> Scene:
        """A bead of 1 µm that starts at `start` of the way from the middle of that trap to its end; `settings` as
        `Settings`.
        """
        law = SHAPES[self.shape]
        x, y, z = PLACE
        trap = Trap(
            prim="/World/trap",
            position=Track.constant(PLACE),
            power=Track.constant(self.power),
            model="piecewise" if math.isfinite(law.threshold) else "harmonic",
            radial=law,
        )
        made = scene(bead(place=(x + start * law.cutoff, y, z)), traps=(trap,), temperature=TEMPERATURE)
        # no frame is to cut a step short
        return replace(made, settings=Settings(frames_per_second=min(self.rate, 1000.0), **settings))


@dataclass(frozen=True)
class Averages:
    """What is seen of a bead; those but `escape` of the beads that are still there.

    Attributes:
        variance: ⟨x²⟩.
        correlation: ⟨x(0) x(t)⟩/⟨x²⟩ at a time t.
        displacement: ⟨(x(dt) − x(0))²⟩ over one time step.
        displacements: The same over five.
        escape: Mean time from the middle to the end.
    """

    variance: float
    correlation: float
    displacement: float
    displacements: float
    escape: float


@dataclass(frozen=True)
class Solution:
    """The Smoluchowski equation in a well whose end takes out whoever reaches it."""

    well: RadialWell
    cells: int = CELLS

    @cached_property
    def _modes(self) -> tuple[np.ndarray, np.ndarray, tuple[tuple[np.ndarray, np.ndarray], ...]]:
        """(n,) middles and weights e^{−U} r² dr of the cells, and rates and modes for scalars and for vectors."""
        faces = np.linspace(0.0, self.well.end, self.cells + 1)
        middle = 0.5 * (faces[1:] + faces[:-1])
        nodes, share = np.polynomial.legendre.leggauss(6)

        def integral(low: np.ndarray, high: np.ndarray, sign: float) -> np.ndarray:
            """∫ e^{±U} r^{∓2} dr."""
            r = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * nodes
            return 0.5 * (high - low) * ((np.exp(sign * self.well.energy(r)) * r ** (-2.0 * sign)) @ share)

        weight = integral(faces[:-1], faces[1:], -1.0)
        flow = 1.0 / integral(middle, np.append(middle[1:], faces[-1]), 1.0)
        modes = []
        for turning in (0.0, 2.0):
            out = (flow + np.append(0.0, flow[:-1])) / weight + turning / middle**2
            modes.append(eigh_tridiagonal(out, -flow[:-1] / np.sqrt(weight[:-1] * weight[1:])))
        return middle, weight, tuple(modes)

    def later(self, values: np.ndarray, time: float, *, vector: bool = False) -> np.ndarray:
        """Mean of a function of r (of r times the direction for a `vector`) a time later, by where the bead is now."""
        _, weight, modes = self._modes
        (rates, shapes), root = modes[vector], np.sqrt(weight)
        return (shapes @ (np.exp(-rates * time) * (shapes.T @ (values * root)))) / root

    @cached_property
    def still_there(self) -> tuple[np.ndarray, float]:
        """(n,) probabilities of the cells for a bead that is still there after a long time, and the rate of loss."""
        _, weight, ((rates, shapes), _) = self._modes
        share = np.abs(shapes[:, 0]) * np.sqrt(weight)
        return share / share.sum(), float(rates[0])

    @property
    def escape(self) -> float:
        """Mean time from the middle to the end."""
        return self.time_until(math.inf)

    def time_until(self, end: float) -> float:
        """Mean time in the well from the middle, counted up to `end`."""
        middle, weight, ((rates, shapes), _) = self._modes
        root = np.sqrt(weight)
        times = (shapes @ ((shapes.T @ root) * -np.expm1(-rates * end) / rates)) / root
        return float(np.interp(0.0, middle, times))

    @cached_property
    def variance(self) -> float:
        """⟨x²⟩ of a bead that is still there."""
        return float(self.still_there[0] @ self._modes[0] ** 2) / 3.0

    def correlation(self, time: float) -> float:
        """⟨x(0) x(t)⟩/⟨x²⟩ of a bead that is still there."""
        (share, rate), r = self.still_there, self._modes[0]
        return float((share * r) @ self.later(r, time, vector=True)) * math.exp(rate * time) / 3.0 / self.variance

    @cached_property
    def forgetting(self) -> float:
        """Time in which correlations fall to 1/e."""
        return float(brentq(lambda t: self.correlation(t) - math.exp(-1.0), 1e-3, 10.0))  # type: ignore[arg-type]

    def displacement(self, time: float) -> float:
        """⟨(x(t) − x(0))²⟩ of a bead that is still there."""
        (share, rate), r = self.still_there, self._modes[0]
        started = float((share * self.later(np.ones_like(r), time)) @ r**2) * math.exp(rate * time) / 3.0
        return self.variance + started - 2.0 * self.variance * self.correlation(time)

    def survival(self, start: float, time: float) -> float:
        """Share of beads from a distance that are still there after a time."""
        r = self._modes[0]
        # a function that vanishes at the end is known there, too
        values = np.append(self.later(np.ones_like(r), time), 0.0)
        return float(np.interp(start, np.append(r, self.well.end), values))

    def averages(self, step: float) -> Averages:
        """All, for a time step: correlations at a time that is a whole number of it."""
        return Averages(
            variance=self.variance,
            correlation=self.correlation(steps_in(self.forgetting, step) * step),
            displacement=self.displacement(step),
            displacements=self.displacement(5.0 * step),
            escape=self.escape,
        )


def steps_in(time: float, step: float) -> int:
    """Whole steps nearest to a time, at least one."""
    return max(1, round(time / step))


@lru_cache(maxsize=64)
def solution(shape: str, depth: float) -> Solution:
    """The equation solved once for each well."""
    return Solution(RadialWell(shape, depth))
