"""Time integrators behind one signature, for lone spheres and rigid bodies alike.

The motion is dx = a(x, t) dt + σ dW with the drift a = M F + u (mobility, forces, flow) and σσᵀ = 2 k_B T M. Positions
of spheres are vectors; rigid bodies move by twists (displacement and rotation vector in world axes), which the
exponential map applies. About the centre of diffusion neither needs a drift correction for M turning with the body
(Brenner 1967, J. Colloid Interface Sci. 23, 407).

An integrator is made of two functions. `predict(model, control, state, constants, world, b, pose, step, time)` returns
a move and the drift at its start, both per step. `correct(…, pose, drift, moved, step, time)` looks again from where
the body came to, contact included, and returns what is to be added to the move; one-stage schemes have none. A new
scheme is such a pair and one line of `INTEGRATORS`.

Weak order is that of averages over many paths: of distributions, correlations and escape times.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

from otwarp.kernels.types import ControlData, ModelData, StateData


@dataclass(frozen=True)
class Dynamics:
    """How one kind of body drifts, diffuses and moves; what an integrator is composed from.

    Attributes:
        pose, move, constants, stiffness_type: Warp types of the functions below.
        drift: `(model, control, state, constants, world, b, pose, time) -> move`, a·dt.
        noise: `(model, constants, world, b, pose, step) -> move`, σ ΔW of that step.
        shifted: `(pose, move) -> pose`.
        pulled_back: `(move, drift) -> drift` found after `move`, as it counts at the start of the move.
        stiffness: `(model, control, state, constants, world, b, pose, time) -> matrix` K, symmetric part of −∂F/∂x.
        relax: `(constants, pose, stiffness, move) -> move`, Z·v with Z = M K dt.
        large: Whether the code of `drift` is so large that it should stand only once.
    """

    pose: type
    move: type
    constants: type
    stiffness_type: type
    drift: wp.Function
    noise: wp.Function
    shifted: wp.Function
    pulled_back: wp.Function
    stiffness: wp.Function | None
    relax: wp.Function | None
    large: bool = False


def predict_euler_maruyama(d: Dynamics) -> wp.Function:
    """x + a dt + σ ΔW."""
    drift_of, noise_of = d.drift, d.noise

    @wp.func
    def predict(
        model: ModelData,
        control: ControlData,
        state: StateData,
        constants: d.constants,
        world: int,
        b: int,
        pose: d.pose,
        step: wp.int64,
        time: wp.float64,
    ):
        """Move and drift."""
        drift = drift_of(model, control, state, constants, world, b, pose, time)
        return drift + noise_of(model, constants, world, b, pose, step), drift

    return predict


def predict_leimkuhler_matthews(d: Dynamics) -> wp.Function:
    """x + a dt + σ (ΔW_n + ΔW_{n+1})/2."""
    drift_of, noise_of = d.drift, d.noise

    @wp.func
    def predict(
        model: ModelData,
        control: ControlData,
        state: StateData,
        constants: d.constants,
        world: int,
        b: int,
        pose: d.pose,
        step: wp.int64,
        time: wp.float64,
    ):
        """Move and drift."""
        drift = drift_of(model, control, state, constants, world, b, pose, time)
        noise = noise_of(model, constants, world, b, pose, step)
        noise += noise_of(model, constants, world, b, pose, step + wp.int64(1))
        return drift + 0.5 * noise, drift

    return predict


def correct_heun(d: Dynamics) -> wp.Function:
    """½ (a(x + moved) − a(x)) dt."""
    drift_of, shifted, pulled_back = d.drift, d.shifted, d.pulled_back

    @wp.func
    def correct(
        model: ModelData,
        control: ControlData,
        state: StateData,
        constants: d.constants,
        world: int,
        b: int,
        pose: d.pose,
        drift: d.move,
        moved: d.move,
        step: wp.int64,
        time: wp.float64,
    ) -> d.move:
        """What the drift at the end changes."""
        there = shifted(pose, moved)
        later = drift_of(model, control, state, constants, world, b, there, time + model.time_step)
        return 0.5 * (pulled_back(moved, later) - drift)

    return correct


def predict_exponential(d: Dynamics) -> wp.Function:
    """x + φ₁(−Z) a dt + q(Z) σ ΔW, exact for a linear force: φ₁(−Z) = (1 − e^{−Z})/Z, q² = (1 − e^{−2Z})/2Z.

    Both by series to Z³, whose error at Z = 0.5 is below 0.001; they only ever multiply vectors.
    """
    drift_of, noise_of, stiffness_of, relax = d.drift, d.noise, d.stiffness, d.relax

    @wp.func
    def predict(
        model: ModelData,
        control: ControlData,
        state: StateData,
        constants: d.constants,
        world: int,
        b: int,
        pose: d.pose,
        step: wp.int64,
        time: wp.float64,
    ):
        """Move and drift."""
        stiffness = stiffness_of(model, control, state, constants, world, b, pose, time)
        drift = drift_of(model, control, state, constants, world, b, pose, time)
        noise = noise_of(model, constants, world, b, pose, step)
        z1 = relax(constants, pose, stiffness, drift)
        z2 = relax(constants, pose, stiffness, z1)
        z3 = relax(constants, pose, stiffness, z2)
        move = drift - 0.5 * z1 + (1.0 / 6.0) * z2 - (1.0 / 24.0) * z3
        n1 = relax(constants, pose, stiffness, noise)
        n2 = relax(constants, pose, stiffness, n1)
        n3 = relax(constants, pose, stiffness, n2)
        return move + noise - 0.5 * n1 + (5.0 / 24.0) * n2 - (1.0 / 16.0) * n3, drift

    return predict


def correct_exponential(d: Dynamics) -> wp.Function:
    """φ₂(−Z) ((a(x + moved) − a(x)) dt + Z moved): what the force differs from a linear one, as Heun would add it.

    φ₂(−Z) = (e^{−Z} − 1 + Z)/Z², by its series to Z².
    """
    drift_of, shifted, pulled_back, stiffness_of, relax = d.drift, d.shifted, d.pulled_back, d.stiffness, d.relax

    @wp.func
    def correct(
        model: ModelData,
        control: ControlData,
        state: StateData,
        constants: d.constants,
        world: int,
        b: int,
        pose: d.pose,
        drift: d.move,
        moved: d.move,
        step: wp.int64,
        time: wp.float64,
    ) -> d.move:
        """What the residual force at the end changes."""
        stiffness = stiffness_of(model, control, state, constants, world, b, pose, time)
        there = shifted(pose, moved)
        later = drift_of(model, control, state, constants, world, b, there, time + model.time_step)
        r0 = pulled_back(moved, later) - drift + relax(constants, pose, stiffness, moved)
        r1 = relax(constants, pose, stiffness, r0)
        r2 = relax(constants, pose, stiffness, r1)
        return 0.5 * r0 - (1.0 / 6.0) * r1 + (1.0 / 24.0) * r2

    return correct


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """A scheme.

    Attributes:
        predict, correct: Factories of its two functions; `correct` is None for one-stage schemes.
        weak_order: Order of averages in the time step.
        decay: Of a spring of rate k by z = k·dt: mean of x after a step over x before it, e^{−z} if exact.
        variance: Its stationary variance over k_B T/k.
        stable: z up to which it is stable.
        rim: z allowed where an optical force is steepest, at a wanted accuracy of 1 %: there it is far from linear, and
            escapes depend on it. Found by `otwarp bench integrators`.
        source: Where the scheme is described.
        noise_ahead: Steps after the present one whose noise it uses, too.
    """

    predict: Callable[[Dynamics], wp.Function]
    correct: Callable[[Dynamics], wp.Function] | None
    weak_order: int
    decay: Callable[[float], float]
    variance: Callable[[float], float]
    stable: float
    rim: float
    source: str
    noise_ahead: int = 0

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

    def largest_product(self, accuracy: float) -> float:
        """Largest z = k·dt, up to `LONGEST`, at which both errors stay within `accuracy`."""
        low, high = 0.0, LONGEST
        for _ in range(60):
            z = 0.5 * (low + high)
            good = max(abs(self.variance_error(z)), abs(self.rate_error(z))) <= accuracy
            low, high = (z, high) if good else (low, z)
        return low

    def rim_product(self, accuracy: float) -> float:
        """Largest z where a force is steepest; errors grow as its power `weak_order`."""
        return min(self.rim * (accuracy / 0.01) ** (1.0 / self.weak_order), LONGEST)


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
        predict=predict_euler_maruyama,
        correct=None,
        weak_order=1,
        decay=lambda z: 1.0 - z,
        variance=lambda z: 1.0 / (1.0 - 0.5 * z),
        stable=2.0,
        rim=0.045,
        source="Maruyama 1955, doi:10.1007/BF02846028; Ermak & McCammon 1978, doi:10.1063/1.436761",
    ),
    "leimkuhlerMatthews": Integrator(
        predict=predict_leimkuhler_matthews,
        correct=None,
        noise_ahead=1,
        weak_order=1,
        decay=lambda z: 1.0 - z,
        variance=lambda z: 1.0,
        stable=2.0,
        rim=0.06,
        source="Leimkuhler & Matthews 2013, doi:10.1093/amrx/abs010",
    ),
    "heun": Integrator(
        predict=predict_euler_maruyama,
        correct=correct_heun,
        weak_order=2,
        decay=heun_decay,
        variance=lambda z: stationary_variance(heun_decay(z), 1.0 - 0.5 * z, z),
        stable=2.0,
        rim=0.25,
        source="Kloeden & Platen 1992, doi:10.1007/978-3-662-12616-5, section 15.1",
    ),
    "exponential": Integrator(
        predict=predict_exponential,
        correct=correct_exponential,
        weak_order=2,
        decay=exponential_decay,
        variance=lambda z: stationary_variance(
            exponential_decay(z), 1.0 - z / 2.0 + 5.0 / 24.0 * z * z - z**3 / 16.0, z
        ),
        stable=2.0,
        rim=0.25,
        source="Cox & Matthews 2002, doi:10.1006/jcph.2002.6995, with the noise of an Ornstein–Uhlenbeck process",
    ),
}
"""Integrators by the names of `ot:scene:integrator`."""


def whole_step(scheme: Integrator, d: Dynamics) -> wp.Function:
    """`(model, control, state, constants, world, b, pose, step, time) -> move` of a body that touches nothing."""
    if scheme.correct is correct_heun and d.large:
        return heun_in_a_loop(d)
    predict = scheme.predict(d)
    correct = scheme.correct(d) if scheme.correct is not None else None

    @wp.func
    def move_freely(
        model: ModelData,
        control: ControlData,
        state: StateData,
        constants: d.constants,
        world: int,
        b: int,
        pose: d.pose,
        step: wp.int64,
        time: wp.float64,
    ) -> d.move:
        """One step."""
        move, drift = predict(model, control, state, constants, world, b, pose, step, time)
        if wp.static(correct is not None):
            move += correct(model, control, state, constants, world, b, pose, drift, move, step, time)
        return move

    return move_freely


def heun_in_a_loop(d: Dynamics) -> wp.Function:
    """Heun's step as a loop over its two stages, so that a large drift stands once in the code and not twice.

    On a GPU two copies of a robot's forces run out of instruction cache.
    """
    drift_of, noise_of, shifted, pulled_back = d.drift, d.noise, d.shifted, d.pulled_back

    @wp.func
    def move_freely(
        model: ModelData,
        control: ControlData,
        state: StateData,
        constants: d.constants,
        world: int,
        b: int,
        pose: d.pose,
        step: wp.int64,
        time: wp.float64,
    ) -> d.move:
        """One step."""
        move = noise_of(model, constants, world, b, pose, step)
        first = d.move()
        here = pose
        stages = int(2)
        for stage in range(stages):
            drift = drift_of(model, control, state, constants, world, b, here, time)
            if stage == 0:
                first = drift
                move += drift
                here = shifted(pose, move)
                time += model.time_step
            else:
                move += 0.5 * (pulled_back(move, drift) - first)
        return move

    return move_freely
