"""How far paths of every integrator are from the exact path of the same Brownian motion.

The kernels run with their own noise, which the NumPy twin of Philox repeats. For a spring the exact end of the path,
given the increments of all steps, is Gaussian with known mean and variance, so the mean square error of a scheme is a
closed sum. For a trap whose force falls off beyond a threshold the increments are refined by Brownian bridges, and the
path is followed with 16 times as many steps.

Noise that does not depend on the place leaves no scheme that knows only the increments with less than a multiple of dt
(Clark & Cameron 1980, doi:10.1007/BFb0004007): Euler–Maruyama, Heun and the exponential scheme are of strong order 1,
the last one for springs, too, of which it has the exact distribution but not the exact path. The averaged noise of
Leimkuhler and Matthews leaves half an increment at the end: order 1/2; without it, order 1.
"""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.transitions import advance
from otwarp.kernels.core.random import Stream
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.laws import TrapLaw
from otwarp.scene import Medium, Scene, Settings, Track, Trap
from otwarp.simulation.simulation import Simulation
from tests.reference.philox import WEAK, halves, noise_words, normals
from tests.simulation.setups import ENERGY, STIFFNESS, VISCOSITY, drag, sphere_body

RATE = STIFFNESS / drag(1.0)
DIFFUSION = ENERGY / drag(1.0)
SPREAD = float(np.sqrt(ENERGY / STIFFNESS))
TIME = 1.6
"""Length of the paths [γ/k]."""
SEED = 301

THRESHOLD = 0.8 * SPREAD
SOFTENING = TrapLaw(
    stiffness=STIFFNESS,
    threshold=THRESHOLD,
    inverse_square=0.5 * STIFFNESS * THRESHOLD**3,
    offset=0.5 * STIFFNESS * THRESHOLD,
)
"""Continuous at the threshold, where the slope turns from k to −k: half of all places are beyond it."""
SPRING = TrapLaw(stiffness=STIFFNESS, threshold=1e3)

ROUNDING = 2e-7
"""Of a path in float32 [µm]: deviates good to 4e-6 of a kick of 5 nm, places of 50 nm rounded some 100 times."""

REFINED = 16
"""Substeps of the reference: its own error, also of first order, adds (1/16)² to the square of the difference."""


def scene(law: TrapLaw) -> Scene:
    trap = Trap(
        prim="/World/Trap",
        position=Track.constant((0.0, 0.0, 0.0)),
        power=Track.constant(law.power),
        model="piecewise",
        radial=law,
    )
    return Scene(medium=Medium(viscosity=VISCOSITY), bodies=(sphere_body("Bead"),), traps=(trap,), settings=Settings())


def kicks(worlds: int, steps: int, h: float, noise: str = "gaussian") -> np.ndarray:
    """(steps + 1, W, 3) displacements √(2D dt) ξ of the kernels; the last one is needed by averaged noise."""
    step, world = np.arange(steps + 1)[:, None], np.arange(worlds)[None, :]
    words = noise_words(seed=SEED, stream=Stream.BROWNIAN_A, step=step, world=world, body=0)
    deviates = normals(words) if noise == "gaussian" else WEAK[noise](halves(words))
    return SPREAD * np.sqrt(2.0 * h) * deviates[..., :3]


def ends(
    law: TrapLaw, name: str, device: str, worlds: int, steps: int, start: np.ndarray, noise: str = "gaussian"
) -> np.ndarray:
    """(W, 3) where the kernels' paths end [µm]."""
    how = {"time_step": TIME / RATE / steps, "integrator": name, "noise": noise}
    sim = Simulation(scene(law), worlds=worlds, seed=SEED, device=device, allow_large_step=True, **how)
    sim.set_state(position=start[:, None])
    sim.step(steps)
    return sim.state.position.numpy()[:, 0].astype(float)


def force_ratio(law: TrapLaw, x: np.ndarray) -> np.ndarray:
    """(..., 1) f(d)/d [pN/µm]."""
    d = np.linalg.norm(x, axis=-1, keepdims=True)
    beyond = np.maximum(d, law.threshold)
    return np.where(d < law.threshold, law.stiffness, (law.inverse_square / beyond**2 + law.offset) / beyond)


def stiffness_times(law: TrapLaw, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(..., 3) −∂F/∂x · v."""
    d = np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-12)
    ratio = force_ratio(law, x)
    slope = np.where(d < law.threshold, law.stiffness, -2.0 * law.inverse_square / np.maximum(d, law.threshold) ** 3)
    n = x / d
    return ratio * v + (slope - ratio) * np.sum(n * v, axis=-1, keepdims=True) * n


def step(law: TrapLaw, name: str, h: float, x: np.ndarray, kick: np.ndarray) -> np.ndarray:
    """One step of the twin."""
    scale = h / STIFFNESS
    return advance(
        name,
        x,
        kick,
        lambda y: -scale * force_ratio(law, y) * y,
        lambda y, v: scale * stiffness_times(law, y, v),
    )


@pytest.mark.parametrize(
    ("name", "noise"), [*((name, "gaussian") for name in INTEGRATORS), ("heun", "threePoint"), ("heun", "uniform")]
)
def test_paths_of_the_twin(expect_law, device, name, noise):
    """Every scheme's path in the softening trap is that of its float64 twin on the same noise, step by step.

    Source: `benchmarks.transitions.advance`, written from the schemes' publications; `tests/reference/philox.py`.
    """
    worlds, steps = 300, 32
    kick = kicks(worlds, steps, TIME / steps, noise)
    late = 0.5 if name == "leimkuhlerMatthews" else 0.0
    y = -late * kick[0]
    for n in range(steps):
        y = step(SOFTENING, name, TIME / steps, y, kick[n])
    found = ends(SOFTENING, name, device, worlds, steps, np.zeros((worlds, 3)), noise)
    expect_law(f"{name}, {noise} noise: distance from the twin's path [µm]", found, y + late * kick[steps], ROUNDING)


def spring_error(name: str, h: float, steps: int, shown: bool) -> float:
    """Root of the mean square error of one coordinate at the end of a path from 0, over √(k_B T/k).

    ΔW of a step and I = ∫e^{−κ(dt − s)}dW have variances dt and (1 − e^{−2h})/2κ and the covariance (1 − e^{−h})/κ;
    the scheme's weight of ΔW_n less the exact weight of I_n, squared and summed.
    """
    exact = np.exp(-h * (steps - 1.0 - np.arange(steps)))
    if name == "leimkuhlerMatthews":
        # of y = x − ΔW/2, with the force at y + ΔW/2
        weight = (1.0 - h) ** (steps - 1.0 - np.arange(steps)) * (1.0 - 0.5 * h)
    else:
        value = INTEGRATORS[name]
        decay = value.decay(h)
        noise = np.sqrt(value.variance(h) * (1.0 - decay**2) / (2.0 * h))
        weight = noise * decay ** (steps - 1.0 - np.arange(steps))
    own, cross, kept = h, -np.expm1(-h), -0.5 * np.expm1(-2.0 * h)
    square = 2.0 * np.sum(weight**2 * own - 2.0 * weight * exact * cross + exact**2 * kept)
    return float(np.sqrt(square + (0.5 * h if shown else 0.0)))


def spring_ends(kick: np.ndarray, h: float) -> np.ndarray:
    """(W, 3) exact ends of paths from 0 with these increments, the rest of each I drawn anew."""
    steps = len(kick) - 1
    rng = np.random.default_rng(7)
    share = -np.expm1(-h) / h
    rest = SPREAD * np.sqrt(2.0 * (-0.5 * np.expm1(-2.0 * h) - share**2 * h))
    x = np.zeros_like(kick[0])
    for n in range(steps):
        x = np.exp(-h) * x + share * kick[n] + rest * rng.standard_normal(x.shape)
    return x


def forms(name: str) -> tuple[bool, ...]:
    """Whether to take a run's places as they are; of averaged noise, also without half the last increment."""
    return (False, True) if name == "leimkuhlerMatthews" else (False,)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_strong_error_in_a_spring(expect_law, device, name):
    """Distance of the kernels' paths from the exact ones has the root mean square of the closed sum, at three steps.

    Source: Gaussian increments and their Ornstein–Uhlenbeck integral, summed; Clark & Cameron 1980,
    doi:10.1007/BFb0004007, that no scheme does better than order 1.
    """
    worlds = 3000
    for steps in (16, 32, 64):
        h = TIME / steps
        kick = kicks(worlds, steps, h)
        exact = spring_ends(kick, h)
        for shown in forms(name):
            half = 0.5 if name == "leimkuhlerMatthews" else 0.0
            found = ends(SPRING, name, device, worlds, steps, half * kick[0])
            away = (found - (0.0 if shown else half * kick[steps]) - exact) / SPREAD
            expected = spring_error(name, h, steps, shown)
            # the relative error of a mean square of 3 W Gaussian numbers is √(2/3W)
            expect_law(
                f"{name}{' as shown' if shown else ''}, h = {h:g}: rms distance from the exact path, over the law",
                np.sqrt(np.mean(away**2)) / expected,
                1.0,
                1.0 / np.sqrt(6.0 * worlds),
            )


def refined_ends(law: TrapLaw, kick: np.ndarray, h: float) -> np.ndarray:
    """(W, 3) ends of paths from 0, every increment refined by a Brownian bridge and followed by Heun's scheme."""
    rng = np.random.default_rng(8)
    x = np.zeros_like(kick[0])
    fine = h / REFINED
    for n in range(len(kick) - 1):
        parts = SPREAD * np.sqrt(2.0 * fine) * rng.standard_normal((REFINED, *x.shape))
        parts += (kick[n] - parts.sum(axis=0)) / REFINED
        for part in parts:
            x = step(law, "heun", fine, x, part)
    return x


WORLDS = 1500
STEPS = (16, 32, 64)


@pytest.fixture(scope="module")
def refined() -> dict[int, np.ndarray]:
    """Ends in the softening trap by number of steps."""
    return {n: refined_ends(SOFTENING, kicks(WORLDS, n, TIME / n), TIME / n) for n in STEPS}


ORDER_BIAS = 0.1
"""Terms of the next order, h = 0.1 to 0.025 relative to the first, change a slope by no more than a mean h/ln 2."""


@pytest.mark.parametrize("name", INTEGRATORS)
def test_strong_order_in_a_softening_trap(expect_law, device, name, refined):
    """Halving the step halves the distance from the path of 16 times finer steps; by √2 with averaged noise as shown.

    Source: Kloeden & Platen 1992, doi:10.1007/978-3-662-12616-5, §10: strong order 1 of additive noise; Vilmart 2015,
    doi:10.1137/140974328, for averaged noise without half its last increment.
    """
    for shown in forms(name):
        half = 0.5 if name == "leimkuhlerMatthews" else 0.0
        squares = []
        for steps in STEPS:
            kick = kicks(WORLDS, steps, TIME / steps)
            found = ends(SOFTENING, name, device, WORLDS, steps, half * kick[0])
            away = found - (0.0 if shown else half * kick[steps]) - refined[steps]
            squares.append(np.sum(away**2, axis=1))
        halvings = np.log2(STEPS[-1] / STEPS[0])
        order = 0.5 * np.log2(squares[0].mean() / squares[-1].mean()) / halvings
        spread = [s.std() / s.mean() / np.sqrt(WORLDS) for s in (squares[0], squares[-1])]
        error = 0.5 * np.hypot(*spread) / np.log(2.0) / halvings
        label = f"{name}{' as shown' if shown else ''}: strong order"
        expect_law(label, order, 0.5 if shown else 1.0, error, bias=ORDER_BIAS)
