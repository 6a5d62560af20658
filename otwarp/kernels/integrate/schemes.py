"""Steps of the equation of motion, in terms of any `Dynamics`.

A scheme is one or two functions. `predict(model, control, state, constants, world, b, pose, step, time)` returns a move
and the drift at its start, both per step. `correct(…, pose, drift, moved, step, time)` looks again from where the body
came to, contact included, and returns what is to be added to the move. Where nothing touches, a two-stage scheme may
have a form that does both.
"""

import warp as wp

from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.types import ControlData, ModelData, StateData

EARLY = 2.0**-16
"""Of a step by which its second stage looks before its end, where commands leap from step to step: enough to tell
float64 times of long runs apart."""

_PART = wp.constant(wp.float64(1.0 - EARLY))


@wp.func
def end_of_step(model: ModelData, time: wp.float64) -> wp.float64:
    """Time [s] at the end of the step from `time`."""
    return time + model.time_step


@wp.func
def just_before_end(model: ModelData, time: wp.float64) -> wp.float64:
    """The last moment [s] of the step from `time`."""
    return time + _PART * model.time_step


def second_look(early: bool) -> wp.Function:
    """`(model, time) -> time` of the second stage of a step that starts at `time`; `early` as in `Dynamics`."""
    return just_before_end if early else end_of_step


def second_constants(d: Dynamics) -> wp.Function:
    """`(constants, move) -> constants` of the second stage of a step."""

    @wp.func
    def unchanged(constants: d.constants, move: d.move) -> d.constants:
        """The constants of the step [those of `d.constants`] wherever the first stage has led."""
        return constants

    return d.strayed or unchanged


def predict_euler_maruyama(d: Dynamics) -> wp.Function:
    """x + a dt + σ ΔW."""
    drift_of, noise_of = d.drift, d.noise

    @wp.func
    def predict(
        model: ModelData, control: ControlData, state: StateData, constants: d.constants, world: int, b: int,
        pose: d.pose, step: wp.int64, time: wp.float64,
    ):  # fmt: skip
        """Move of Euler–Maruyama's step, and its drift a dt [µm, or µm and rad]."""
        drift = drift_of(model, control, state, constants, world, b, pose, time)
        return drift + noise_of(model, constants, world, b, pose, step), drift

    return predict


def predict_leimkuhler_matthews(d: Dynamics) -> wp.Function:
    """x + a dt + σ (ΔW_n + ΔW_{n+1})/2."""
    drift_of, noise_of = d.drift, d.noise

    @wp.func
    def predict(
        model: ModelData, control: ControlData, state: StateData, constants: d.constants, world: int, b: int,
        pose: d.pose, step: wp.int64, time: wp.float64,
    ):  # fmt: skip
        """Move with the noise of this step and the next, and its drift a dt [µm, or µm and rad]."""
        drift = drift_of(model, control, state, constants, world, b, pose, time)
        noise = noise_of(model, constants, world, b, pose, step)
        noise += noise_of(model, constants, world, b, pose, step + wp.int64(1))
        return drift + 0.5 * noise, drift

    return predict


def correct_heun(d: Dynamics) -> wp.Function:
    """½ (a(x + moved) − a(x)) dt."""
    drift_of, shifted, pulled_back = d.drift, d.shifted, d.pulled_back
    end_of, second = second_look(d.early), second_constants(d)

    @wp.func
    def correct(
        model: ModelData, control: ControlData, state: StateData, constants: d.constants, world: int, b: int,
        pose: d.pose, drift: d.move, moved: d.move, step: wp.int64, time: wp.float64,
    ) -> d.move:  # fmt: skip
        """Half of what the drift changes [µm, rad] from the start of the step to its end."""
        there = shifted(pose, moved)
        later = drift_of(model, control, state, second(constants, moved), world, b, there, end_of(model, time))
        return 0.5 * (pulled_back(moved, later) - drift)

    return correct


def series_term(d: Dynamics, first: float, second: float, third: float) -> wp.Function:
    """`(constants, pose, stiffness, v) -> (1 + first·Z + second·Z² + third·Z³) v` with Z = M K dt, by products."""
    relax = d.relax

    @wp.func
    def series(constants: d.constants, pose: d.pose, stiffness: d.stiffness_type, v: d.move) -> d.move:
        """The series applied to a move [µm, rad] in three products with Z."""
        z1 = relax(constants, pose, stiffness, v)
        z2 = relax(constants, pose, stiffness, z1)
        z3 = relax(constants, pose, stiffness, z2)
        return v + wp.static(first) * z1 + wp.static(second) * z2 + wp.static(third) * z3

    return series


def exponential_terms(d: Dynamics) -> tuple[wp.Function, wp.Function, wp.Function]:
    """φ₁(−Z) = (1 − e^{−Z})/Z, q(Z) = √((1 − e^{−2Z})/2Z) and 2φ₂(−Z) = 2 (e^{−Z} − 1 + Z)/Z², as `series_term`."""
    return (
        series_term(d, -1.0 / 2.0, 1.0 / 6.0, -1.0 / 24.0),
        series_term(d, -1.0 / 2.0, 5.0 / 24.0, -1.0 / 16.0),
        series_term(d, -1.0 / 3.0, 1.0 / 12.0, -1.0 / 60.0),
    )


def predict_exponential(d: Dynamics) -> wp.Function:
    """x + φ₁(−Z) a dt + q(Z) σ ΔW, exact for a linear force; the error of the series at Z = 0.5 is below 0.001."""
    drift_of, noise_of, stiffness_of = d.drift, d.noise, d.stiffness
    mean, spread, _ = exponential_terms(d)

    @wp.func
    def predict(
        model: ModelData, control: ControlData, state: StateData, constants: d.constants, world: int, b: int,
        pose: d.pose, step: wp.int64, time: wp.float64,
    ):  # fmt: skip
        """Move of the first stage, and its drift a dt [µm, or µm and rad]."""
        stiffness = stiffness_of(model, control, state, constants, world, b, pose, time)
        drift = drift_of(model, control, state, constants, world, b, pose, time)
        noise = noise_of(model, constants, world, b, pose, step)
        move = mean(constants, pose, stiffness, drift) + spread(constants, pose, stiffness, noise)
        return move, drift

    return predict


def correct_exponential(d: Dynamics) -> wp.Function:
    """φ₂(−Z) ((a(x + moved) − a(x)) dt + Z moved): what the force differs from a linear one, as Heun would add it."""
    drift_of, shifted, pulled_back, stiffness_of, relax = d.drift, d.shifted, d.pulled_back, d.stiffness, d.relax
    end_of, second = second_look(d.early), second_constants(d)
    _, _, twice = exponential_terms(d)

    @wp.func
    def correct(
        model: ModelData, control: ControlData, state: StateData, constants: d.constants, world: int, b: int,
        pose: d.pose, drift: d.move, moved: d.move, step: wp.int64, time: wp.float64,
    ) -> d.move:  # fmt: skip
        """φ₂(−Z) times the residual drift at the end of the step [µm, rad]."""
        stiffness = stiffness_of(model, control, state, constants, world, b, pose, time)
        there = shifted(pose, moved)
        later = drift_of(model, control, state, second(constants, moved), world, b, there, end_of(model, time))
        residual = pulled_back(moved, later) - drift + relax(constants, pose, stiffness, moved)
        return 0.5 * twice(constants, pose, stiffness, residual)

    return correct


def exponential_at_once(d: Dynamics) -> wp.Function:
    """Both stages of the exponential step, with one look at the stiffness."""
    drift_of, noise_of, shifted, pulled_back = d.drift, d.noise, d.shifted, d.pulled_back
    end_of, second = second_look(d.early), second_constants(d)
    stiffness_of, relax = d.stiffness, d.relax
    mean, spread, twice = exponential_terms(d)

    @wp.func
    def move_freely(
        model: ModelData, control: ControlData, state: StateData, constants: d.constants, world: int, b: int,
        pose: d.pose, step: wp.int64, time: wp.float64,
    ) -> d.move:  # fmt: skip
        """Move of one step with both stages [µm, or µm and rad]."""
        stiffness = stiffness_of(model, control, state, constants, world, b, pose, time)
        drift = drift_of(model, control, state, constants, world, b, pose, time)
        noise = noise_of(model, constants, world, b, pose, step)
        move = mean(constants, pose, stiffness, drift) + spread(constants, pose, stiffness, noise)
        there = shifted(pose, move)
        later = drift_of(model, control, state, second(constants, move), world, b, there, end_of(model, time))
        residual = pulled_back(move, later) - drift + relax(constants, pose, stiffness, move)
        return move + 0.5 * twice(constants, pose, stiffness, residual)

    return move_freely


def heun_in_a_loop(d: Dynamics) -> wp.Function:
    """Heun's step as a loop over its two stages, so that a large drift stands once in the code and not twice.

    On a GPU two copies of a robot's forces run out of instruction cache.
    """
    drift_of, noise_of, shifted, pulled_back = d.drift, d.noise, d.shifted, d.pulled_back
    end_of = second_look(d.early)

    @wp.func
    def move_freely(
        model: ModelData, control: ControlData, state: StateData, constants: d.constants, world: int, b: int,
        pose: d.pose, step: wp.int64, time: wp.float64,
    ) -> d.move:  # fmt: skip
        """Move of one step with both stages [µm, or µm and rad]."""
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
                time = end_of(model, time)
            else:
                move += 0.5 * (pulled_back(move, drift) - first)
        return move

    return move_freely
