"""What an integrator makes of a well in one dimension, step by step and without Monte-Carlo noise.

One time step takes a bead from x to Φ(x, ξ). As an operator on functions, (P g)(x) = E g(Φ(x, ξ)) with the expectation
over the noise by quadrature, it holds everything that long runs know: stationary averages (π P = π), correlations
(Pⁿ g) and escape times (m = 1 + Q m, Q being P less what has escaped). Functions are splines through their values at
nodes, so that errors of the time step of 10⁻⁶ can be seen; Monte Carlo would need 10¹² samples.

Lengths are in √(k_B T/k), times in γ/k, forces in √(k k_B T), k being the stiffness at the bottom of the well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import cumulative_simpson, quad, simpson
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import expm
from scipy.sparse import csr_array

Field = Callable[[np.ndarray], np.ndarray]
Relax = Callable[[np.ndarray, np.ndarray], np.ndarray]

DEGREE = 5
"""Of the splines."""

NODES = 401
"""Of the splines, over the whole well."""

QUADRATURE = {"gaussian": 321, "uniform": 160}
"""Points of the expectation over continuous noise; the gaussian one ends at ±8."""


def advance(name: str, x: np.ndarray, kick: np.ndarray, drift: Field, relax: Relax) -> np.ndarray:
    """One step of an integrator as the kernels take it, in float64.

    Of `leimkuhlerMatthews`, whose step is x + a dt + (ΔW_n + ΔW_{n+1})/2, this is the step of y_n = x_n − ΔW_n/2: it
    needs the noise of one step only (Vilmart 2015, doi:10.1137/140974328).

    Args:
        name: One of `otwarp.kernels.integrate.integrators.INTEGRATORS`.
        x: Positions, of any shape.
        kick: σΔW, of the same shape.
        drift: Position → displacement by the force in one step.
        relax: (position, v) → Z v, Z = M K dt of the stiffness there.
    """
    if name == "leimkuhlerMatthews":
        return x + drift(x + 0.5 * kick) + kick
    first = drift(x)
    if name == "eulerMaruyama":
        return x + first + kick
    if name == "heun":
        move = first + kick
        return x + move + 0.5 * (drift(x + move) - first)
    assert name == "exponential", name

    def series(v: np.ndarray, *factors: float) -> np.ndarray:
        total, power = v, v
        for factor in factors:
            power = relax(x, power)
            total = total + factor * power
        return total

    move = series(first, -1.0 / 2.0, 1.0 / 6.0, -1.0 / 24.0) + series(kick, -1.0 / 2.0, 5.0 / 24.0, -1.0 / 16.0)
    residual = drift(x + move) - first + relax(x, move)
    return x + move + 0.5 * series(residual, -1.0 / 3.0, 1.0 / 12.0, -1.0 / 60.0)


def deviates(noise: str) -> tuple[np.ndarray, np.ndarray]:
    """(q,) values and (q,) weights of one step's deviate, of mean 0 and variance 1."""
    if noise == "threePoint":
        root = math.sqrt(3.0)
        return np.array([-root, 0.0, root]), np.array([1.0, 4.0, 1.0]) / 6.0
    if noise == "uniform":
        x, w = np.polynomial.legendre.leggauss(QUADRATURE[noise])
        return math.sqrt(3.0) * x, 0.5 * w
    assert noise == "gaussian", noise
    # the trapezoidal rule converges faster than any power for an integrand that is smooth and ends
    x = np.linspace(-8.0, 8.0, QUADRATURE[noise])
    w = np.exp(-0.5 * x * x)
    return x, w / w.sum()


@dataclass(frozen=True)
class SineWell:
    """U(x) = (depth/2)(1 − cos(x/w)), w² = depth/2: a trap whose force falls off and vanishes at ±πw.

    Attributes:
        depth: [k_B T].
        share: The rim ±share·πw, where a bead is lost, or turned back where averages are taken.
    """

    depth: float
    share: float = 1.0

    @property
    def width(self) -> float:
        """w."""
        return math.sqrt(0.5 * self.depth)

    @property
    def rim(self) -> float:
        """Where the well ends."""
        return self.share * math.pi * self.width

    def force(self, x: np.ndarray) -> np.ndarray:
        """−U'(x)."""
        return -self.width * np.sin(x / self.width)

    def stiffness(self, x: np.ndarray) -> np.ndarray:
        """U''(x)."""
        return np.cos(x / self.width)

    def energy(self, x: float) -> float:
        """U(x) [k_B T]."""
        return 0.5 * self.depth * (1.0 - math.cos(x / self.width))

    def variance(self) -> float:
        """⟨x²⟩ of Boltzmann's distribution between the rims."""
        norm, second = (quad(lambda x, n=n: x**n * math.exp(-self.energy(x)), 0.0, self.rim)[0] for n in (0, 2))
        return second / norm

    def correlation(self, lag: float, cells: int = 400) -> float:
        """⟨x(0) x(t)⟩/⟨x²⟩ between reflecting rims at ±πw: L f = f'' − U' f' as a matrix of sine functions."""
        assert self.share == 1.0, "the functions have no slope at ±πw"
        # x belongs to the odd functions with no slope at the rim: sin((j + ½) x/w)
        order = np.arange(cells // 2) + 0.5
        w = self.width
        generator = np.diag(-((order / w) ** 2))
        # −w sin(u) d/dx sin(q u) = −q sin(u) cos(q u) = −(q/2) (sin((q + 1) u) − sin((q − 1) u))
        for j, q in enumerate(order):
            if j + 1 < len(order):
                generator[j + 1, j] -= 0.5 * q
            if j > 0:
                generator[j - 1, j] += 0.5 * q
            else:
                # sin((½ − 1) u) = −sin(½ u)
                generator[0, 0] -= 0.5 * q
        # x = Σ a_j sin(q_j u), integrated by parts: a_j = (2 w/π)(−1)^j/q_j²
        start = 2.0 * w / math.pi * (-1.0) ** np.arange(len(order)) / order**2
        later = expm(generator * lag) @ start
        u, weight = np.polynomial.legendre.leggauss(2 * cells)
        u, weight = 0.5 * math.pi * (u + 1.0), 0.5 * math.pi * weight
        density = weight * np.exp(-0.5 * self.depth * (1.0 - np.cos(u)))
        x = w * u
        return float(density @ (x * (np.sin(np.outer(u, order)) @ later)) / (density @ x**2))

    def escape_time(self) -> float:
        """∫₀^R dx e^{U(x)} ∫₀ˣ ds e^{−U(s)}: mean time from the bottom to either rim."""
        x = np.linspace(0.0, self.rim, 4001)
        energy = 0.5 * self.depth * (1.0 - np.cos(x / self.width))
        return float(simpson(np.exp(energy) * cumulative_simpson(np.exp(-energy), x=x, initial=0.0), x=x))


@dataclass(frozen=True, eq=False)
class Chain:
    """The chain that an integrator makes of a well.

    Attributes:
        integrator: Its name.
        noise: `gaussian`, `threePoint` or `uniform`.
        well: Where the bead is.
        step: h, the time step over γ/k.
        nodes: Of the functions.
    """

    integrator: str
    noise: str
    well: SineWell
    step: float
    nodes: int = NODES

    @cached_property
    def x(self) -> np.ndarray:
        """(n,) nodes, from rim to rim."""
        return np.linspace(-self.well.rim, self.well.rim, self.nodes)

    @cached_property
    def _kicks(self) -> tuple[np.ndarray, np.ndarray]:
        """(q,) σΔW and their weights."""
        value, weight = deviates(self.noise)
        return math.sqrt(2.0 * self.step) * value, weight

    @cached_property
    def ends(self) -> np.ndarray:
        """(n, q) where the step leads from each node."""
        start, kick = np.meshgrid(self.x, self._kicks[0], indexing="ij")
        force, stiffness, h = self.well.force, self.well.stiffness, self.step
        return advance(self.integrator, start, kick, lambda x: h * force(x), lambda x, v: h * stiffness(x) * v)

    @cached_property
    def places(self) -> np.ndarray:
        """(n, q) positions that a run shows at the start of the step."""
        half = 0.5 if self.integrator == "leimkuhlerMatthews" else 0.0
        return self.x[:, None] + half * self._kicks[0][None, :]

    def _operator(self, weight: np.ndarray) -> np.ndarray:
        """(n, n) g ↦ Σ_q weight_iq g(ends_iq), reflected at the rims."""
        rim = self.well.rim
        folded = np.abs((self.ends + rim) % (4.0 * rim) - 2.0 * rim)
        at = rim - folded
        # values at the nodes → coefficients → values at the ends → sums over the noise
        identity = make_interp_spline(self.x, np.eye(self.nodes), k=DEGREE)
        basis = BSpline.design_matrix(np.clip(at.ravel(), -rim, rim), identity.t, DEGREE)
        rows = np.arange(0, at.size + 1, at.shape[1])
        sums = csr_array((weight.ravel(), np.arange(at.size), rows), shape=(self.nodes, at.size))
        return (sums @ basis).toarray() @ identity.c

    @cached_property
    def operator(self) -> np.ndarray:
        """(n, n) P."""
        return self._operator(np.tile(self._kicks[1], (self.nodes, 1)))

    @cached_property
    def stationary(self) -> np.ndarray:
        """(n,) weights π of the nodes, π P = π."""
        equations = self.operator.T - np.eye(self.nodes)
        equations[0] = 1.0
        right = np.zeros(self.nodes)
        right[0] = 1.0
        return np.linalg.solve(equations, right)

    def variance(self) -> float:
        """⟨x²⟩ of what a run shows."""
        return float(self.stationary @ (self.places**2 @ self._kicks[1]))

    def correlation(self, steps: int) -> float:
        """⟨x_0 x_n⟩/⟨x²⟩ of what a run shows, n > 0."""
        later = self.places @ self._kicks[1]
        for _ in range(steps - 1):
            later = self.operator @ later
        return float(self.stationary @ (self._operator(self.places * self._kicks[1]) @ later)) / self.variance()

    def escape_time(self) -> float:
        """Mean time from the bottom to the rim, with crossings between steps as in `kernels.optics.escapes`.

        An escape counts for the middle of its step. Not for `leimkuhlerMatthews`, whose ends are not what a run shows.
        """
        assert self.integrator != "leimkuhlerMatthews", "escapes are looked for where a run shows the bead"
        rim, spread2 = self.well.rim, 2.0 * self.step
        before, after = rim - np.abs(self.x)[:, None], rim - np.abs(self.ends)
        kept = np.where(after > 0.0, -np.expm1(-2.0 * before * np.maximum(after, 0.0) / spread2), 0.0)
        survivors = self._operator(kept * self._kicks[1])
        steps = np.linalg.solve(np.eye(self.nodes) - survivors, np.ones(self.nodes))
        return self.step * (float(np.interp(0.0, self.x, steps)) - 0.5)
