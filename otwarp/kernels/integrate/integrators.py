"""Time integrators behind one signature, for lone spheres and rigid bodies alike.

The motion is dx = a(x, t) dt + σ dW with the drift a = M F + u (mobility, forces, flow) and σσᵀ = 2 k_B T M. A new
scheme is one or two functions of `schemes` and one line of `INTEGRATORS`. Weak order is that of averages over many
paths: of distributions, correlations and escape times.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.types import ControlData, ModelData, StateData
from otwarp.kernels.integrate.schemes import (
    correct_exponential,
    correct_heun,
    exponential_at_once,
    heun_in_a_loop,
    predict_euler_maruyama,
    predict_exponential,
    predict_leimkuhler_matthews,
)


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """A scheme.

    Attributes:
        title: Its name for people.
        predict, correct: Factories of its two functions; `correct` is None for one-stage schemes.
        weak_order: Order of averages in the time step.
        decay: Of a spring of rate k by z = k·dt: mean of x after a step over x before it, e^{−z} if exact.
        variance: Its stationary variance over k_B T/k.
        first: Its correlation after one step, where that is not `decay` already.
        course: What its stages see of a command that varies within a step: the mean ∓ the first times its first moment
            and the second times its change. See `simulation.packing.commands`.
        escapes: Estimated size of the relative error of escape times by z at the rim, where that is more than
            `rim_error`: such errors are told, and steps are not shortened for them.
        stable: z up to which it is stable.
        rim: z allowed where a force is steepest, at a wanted accuracy of 1 %: there it is far from linear, and escapes
            depend on it. Found by `otwarp bench integrators` and `python -m benchmarks --only time_step`.
        source: Where the scheme is described.
        noise_ahead: Steps after the present one whose noise it uses, too.
    """

    title: str
    predict: Callable[[Dynamics], wp.Function]
    correct: Callable[[Dynamics], wp.Function] | None
    weak_order: int
    decay: Callable[[float], float]
    variance: Callable[[float], float]
    course: tuple[float, float]
    stable: float
    rim: float
    source: str
    noise_ahead: int = 0
    first: Callable[[float], float] | None = None
    escapes: Callable[[float], float] | None = None

    @property
    def evaluations(self) -> int:
        """Evaluations of the force in one step."""
        return 1 if self.correct is None else 2

    def variance_error(self, z: float) -> float:
        """Relative error of the stationary variance of a spring with k·dt = z; inf if it is unstable."""
        if z < VANISHING:
            return 0.0
        return self.variance(z) - 1.0 if z < self.stable else math.inf

    def rate_error(self, z: float) -> float:
        """Relative error of the rate at which its correlations decay; inf if it is unstable or overshoots."""
        if z < VANISHING:
            return 0.0
        decay = self.decay(z)
        return -math.log(decay) / z - 1.0 if z < self.stable and decay > 0.0 else math.inf

    def displacement_error(self, z: float) -> float:
        """Relative error of the mean squared displacement over one step; over longer times it is smaller.

        2⟨x²⟩(1 − c) with the correlation c after the step; inf if it is unstable.
        """
        z = max(z, VANISHING)
        if z >= self.stable:
            return math.inf
        correlation = (self.first or self.decay)(z)
        return self.variance(z) * (1.0 - correlation) / -math.expm1(-z) - 1.0

    def largest_product(self, accuracy: float, noise: str = "gaussian") -> float:
        """Largest z = k·dt, up to `LONGEST`, at which all errors stay within `PROMISED` of `accuracy`.

        An error that no step makes small does not count. With uniform noise z is less.
        """
        known = [self.variance_error, self.rate_error, self.displacement_error]
        known = [error for error in known if self.vanishes(error)]
        low, high = 0.0, LONGEST
        for _ in range(60):
            z = 0.5 * (low + high)
            good = max(abs(error(z)) for error in known) <= PROMISED * accuracy
            low, high = (z, high) if good else (low, z)
        return min(low, self.rim_product(accuracy, noise)) if noise == "uniform" else low

    def rim_product(self, accuracy: float, noise: str) -> float:
        """Largest z where a force is steepest; errors grow as its power `weak_order`, with uniform noise as itself."""
        if noise == "uniform":
            return min(FIRST_ORDER_RIM * accuracy / 0.01, LONGEST)
        return min(self.rim * (accuracy / 0.01) ** (1.0 / self.weak_order), LONGEST)

    def rim_error(self, z: float) -> float:
        """Estimated size of the relative error of escape times and survival, with z where a force is steepest."""
        return PROMISED * 0.01 * (z / self.rim) ** self.weak_order

    def lasting_error(self, z: float, noise: str) -> float:
        """That part of it which no step makes small at a reasonable cost: it is reported."""
        if noise == "uniform":
            return UNIFORM_ESCAPES * z
        error = self.escapes(z) if self.escapes else 0.0
        return error + (THREE_POINT_ESCAPES * math.sqrt(z) if noise == "threePoint" else 0.0)

    def vanishes(self, error: Callable[[float], float]) -> bool:
        """Whether an error of this scheme, a function of z, falls to nothing with z."""
        return abs(error(VANISHING)) < 0.01


FIRST_ORDER_RIM = 0.045
"""`rim` of schemes of first order."""

UNIFORM_ESCAPES, THREE_POINT_ESCAPES = 2.0, 0.03
"""Relative errors of escape times with cheaper noise, over z and √z: see docs/validation/weak_noise.md."""

PROMISED = 0.7
"""Of the wanted accuracy what the errors of a spring may take: forces are not quite linear."""

VANISHING = 1e-6
"""k·dt below which a step has no error, and differences from 1 no digits left."""

LONGEST = 0.5
"""Largest k·dt that any accuracy is given: forces are not linear over what noise moves in a longer step."""


def stationary_variance(decay: float, noise: float, z: float) -> float:
    """Variance over k_B T/k of x' = decay·x + noise·√(2 D dt) ξ."""
    return 2.0 * z * noise * noise / (1.0 - decay * decay)


def heun_decay(z: float) -> float:
    """Mean of one Heun step of a spring."""
    return 1.0 - z + 0.5 * z * z


def exponential_decay(z: float) -> float:
    """Mean of one exponential step of a spring: e^{−z} as far as the series goes."""
    return 1.0 - z + z * z / 2.0 - z**3 / 6.0 + z**4 / 24.0


INTEGRATORS: dict[str, Integrator] = {
    "eulerMaruyama": Integrator(
        title="Euler–Maruyama",
        predict=predict_euler_maruyama,
        correct=None,
        weak_order=1,
        decay=lambda z: 1.0 - z,
        variance=lambda z: 1.0 / (1.0 - 0.5 * z),
        course=(0.0, 0.0),
        stable=2.0,
        rim=FIRST_ORDER_RIM,
        # the variance of a spring is z/2 too large, so the barrier too low by as much
        escapes=lambda z: 3.0 * z,
        source="Maruyama 1955, doi:10.1007/BF02846028; Ermak & McCammon 1978, doi:10.1063/1.436761",
    ),
    "leimkuhlerMatthews": Integrator(
        title="Leimkuhler–Matthews",
        predict=predict_leimkuhler_matthews,
        correct=None,
        noise_ahead=1,
        weak_order=1,
        decay=lambda z: 1.0 - z,
        variance=lambda z: 1.0,
        first=lambda z: 1.0 - 0.5 * z,
        course=(0.0, 0.0),
        stable=2.0,
        rim=0.06,
        # two steps share noise, while crossings between steps are looked for as if they did not
        escapes=lambda z: 0.5 * math.sqrt(z),
        source="Leimkuhler & Matthews 2013, doi:10.1093/amrx/abs010",
    ),
    "heun": Integrator(
        title="Heun",
        predict=predict_euler_maruyama,
        correct=correct_heun,
        weak_order=2,
        decay=heun_decay,
        variance=lambda z: stationary_variance(heun_decay(z), 1.0 - 0.5 * z, z),
        course=(2.0, 1.0 / 3.0),
        stable=2.0,
        rim=0.25,
        source="Kloeden & Platen 1992, doi:10.1007/978-3-662-12616-5, section 15.1",
    ),
    "exponential": Integrator(
        title="exponential",
        predict=predict_exponential,
        correct=correct_exponential,
        weak_order=2,
        decay=exponential_decay,
        variance=lambda z: stationary_variance(
            exponential_decay(z), 1.0 - z / 2.0 + 5.0 / 24.0 * z * z - z**3 / 16.0, z
        ),
        course=(6.0, 0.0),
        stable=2.0,
        rim=0.17,
        source="Cox & Matthews 2002, doi:10.1006/jcph.2002.6995, with the noise of an Ornstein–Uhlenbeck process",
    ),
}
"""Integrators by the names of `ot:scene:integrator`."""


def whole_step(scheme: Integrator, d: Dynamics) -> wp.Function:
    """`(model, control, state, constants, world, b, pose, step, time) -> move` of a body that touches nothing."""
    if scheme.correct is correct_heun and d.large and d.strayed is None:
        return heun_in_a_loop(d)
    if scheme.correct is correct_exponential:
        return exponential_at_once(d)
    predict = scheme.predict(d)
    correct = scheme.correct(d) if scheme.correct is not None else None

    @wp.func
    def move_freely(
        model: ModelData, control: ControlData, state: StateData, constants: d.constants, world: int, b: int,
        pose: d.pose, step: wp.int64, time: wp.float64,
    ) -> d.move:  # fmt: skip
        """Move of one step [µm, or µm and rad]: prediction, and correction if the scheme has one."""
        move, drift = predict(model, control, state, constants, world, b, pose, step, time)
        if wp.static(correct is not None):
            move += correct(model, control, state, constants, world, b, pose, drift, move, step, time)
        return move

    return move_freely
