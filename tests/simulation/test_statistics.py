"""Stationary distributions and diffusion: the runs must have the moments that theory gives their own scheme.

Every bound is five standard errors; seeds are fixed, so a test either holds or does not.
"""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.scene import Scene, Settings
from otwarp.simulation.simulation import Simulation
from otwarp.units import BOLTZMANN
from tests.reference.rotations import matrix
from tests.simulation.setups import (
    ENERGY,
    STIFFNESS,
    VISCOSITY,
    bead_scene,
    drag,
    five_sphere_mobility,
    harmonic,
    robot,
    sphere_body,
)

SIGMAS = 5.0
HEUN = INTEGRATORS["heun"]


def sample(sim: Simulation, samples: int, every: int = 1) -> np.ndarray:
    """(samples, W, B, 3) positions, `every` steps apart."""
    out = []
    for _ in range(samples):
        sim.step(every)
        out.append(sim.state.position.numpy().astype(float))
    return np.array(out)


def variance_error(worlds: int, samples: int, correlation: float) -> float:
    """Relative standard error of the variance of W Gaussian chains of N samples with lag-1 correlation φ.

    Var(s²) = 2σ⁴/(W N) · (1 + φ²)/(1 − φ²): the squares of a Gaussian chain are correlated with φ² from step to step
    (Priestley 1981, Spectral Analysis and Time Series, §5.3).
    """
    square = correlation**2
    return float(np.sqrt(2.0 / (worlds * samples) * (1.0 + square) / (1.0 - square)))


def check_bead(integrator: str, worlds: int, samples: int, h: float, device: str, seed: int) -> None:
    """The variance and the lag-1 correlation that the scheme is known to have at h = k·dt/γ.

    That of Leimkuhler and Matthews is not Markovian: x_{n+1} = (1 − h) x_n + (ξ_n + ξ_{n+1})/2 has the lag-1
    correlation 1 − h/2, which decays from there by 1 − h a step.
    """
    rate = STIFFNESS / drag(1.0)
    scheme = INTEGRATORS[integrator]
    how = {"device": device, "integrator": integrator, "allow_large_step": True}
    sim = Simulation(bead_scene(time_step=h / rate), worlds=worlds, seed=seed, **how)
    sim.step(int(20 / h))  # forget the start: e⁻²⁰
    x = sample(sim, samples)[:, :, 0, :]
    exact = ENERGY / STIFFNESS * scheme.variance(h)
    correlation = 1.0 - 0.5 * h if integrator == "leimkuhlerMatthews" else scheme.decay(h)
    error = SIGMAS * variance_error(worlds, samples, correlation)
    np.testing.assert_allclose((x**2).mean(axis=(0, 1)), exact, rtol=error)
    # a lagged covariance of such a chain scatters no more than its variance (Bartlett 1946, doi:10.2307/2983611)
    lagged = (x[1:] * x[:-1]).mean(axis=(0, 1)) / exact
    np.testing.assert_allclose(lagged, correlation, atol=error)
    cross = [(x[..., i] * x[..., j]).mean() / exact for i, j in ((0, 1), (1, 2), (0, 2))]
    np.testing.assert_allclose(cross, 0.0, atol=error)


@pytest.mark.parametrize(
    "integrator", [i if i == "heun" else pytest.param(i, marks=pytest.mark.thorough) for i in INTEGRATORS]
)
def test_bead_in_a_harmonic_trap(integrator, device):
    """At h = 0.4 with a standard error of 0.4 %: the scheme and not its limit, by Euler–Maruyama 25 % above kT/k."""
    check_bead(integrator, 2000, 120, 0.4, device, seed=11)


@pytest.mark.validate
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("h", [0.8, 0.1, 0.02])
def test_bead_in_a_harmonic_trap_precisely(integrator, h, device):
    """Standard error of the variance below 0.1 %, at h = 0.02 0.2 %."""
    check_bead(integrator, 10_000, 1000, h, device, seed=12)


def test_every_world_follows_its_own_parameters(device):
    """Power, stiffness, viscosity and temperature differ per world; 500 worlds share each of four settings.

    Samples are so far apart (φ < 0.1) that the standard error is √(2/(500·3·25)) = 0.7 %.
    """
    worlds, group = 2000, np.arange(2000) % 4
    power = np.array([20.0, 30.0, 20.0, 20.0])[group]
    stiffness = np.array([1.0, 1.0, 2.0, 1.0])[group]
    viscosity = VISCOSITY * np.array([1.0, 1.0, 2.0, 1.5])[group]
    temperature = np.array([298.15, 298.15, 298.15, 400.0])[group]
    dt = 2e-4
    sim = Simulation(
        bead_scene(time_step=dt),
        worlds=worlds,
        seed=5,
        device=device,
        parameters={
            "trap_power": power[:, None],
            "trap_stiffness": stiffness[:, None],
            "medium_viscosity": viscosity,
            "medium_temperature": temperature,
        },
        allow_large_step=True,
    )
    sim.step(100)
    x = sample(sim, 25, every=16)[:, :, 0, :]
    k = power * stiffness
    h = k * dt / (6 * np.pi * viscosity)
    exact = BOLTZMANN * temperature / k * np.array([HEUN.variance(z) for z in h])
    assert len(set(np.round(exact, 9))) == 4
    phi = HEUN.decay(h.min()) ** 16
    assert phi < 0.1
    for g in range(4):
        got = (x[:, group == g] ** 2).mean()
        assert got == pytest.approx(exact[g], rel=SIGMAS * variance_error(500, 3 * 25, phi))


def free_scene() -> Scene:
    """A bead and a five-sphere robot that nothing holds."""
    turn = tuple(np.array([0.5, -0.1, 0.3, 0.8]) / np.linalg.norm([0.5, -0.1, 0.3, 0.8]))
    return Scene(
        bodies=(sphere_body("Bead"), robot("Robot", (5.0, 0, 0), turn)),
        settings=Settings(time_step=1e-3),
    )


def check_diffusion(worlds: int, steps: int, device: str, seed: int) -> None:
    """⟨Δx Δxᵀ⟩ = 2 kT M t in body axes at the start, for times in which the robot hardly turns, and for rotation.

    Standard error of a variance from W worlds: √(2/W) relative; of a covariance √((1 + ρ²)/W) of the root product.
    """
    sim = Simulation(free_scene(), worlds=worlds, seed=seed, device=device)
    start, turn = sim.state.position.numpy().astype(float), sim.model.start_orientation()[1]
    sim.step(steps)
    moved = sim.state.position.numpy().astype(float) - start
    time = steps * sim.time_step
    bead = 2 * ENERGY / drag(1.0) * time
    np.testing.assert_allclose((moved[:, 0] ** 2).mean(axis=0), bead, rtol=SIGMAS * np.sqrt(2 / worlds))
    now = sim.state.orientation.numpy().astype(float)[:, 1]
    angle = rotation_vectors(now, turn)
    body = matrix(turn)
    six = np.concatenate([moved[:, 1] @ body, angle @ body], axis=1)
    expected = 2 * ENERGY / VISCOSITY * time * five_sphere_mobility().mobility
    root = np.sqrt(np.diag(expected))
    got = six.T @ six / worlds / np.outer(root, root)
    # turning during the run mixes the axes by the mean square angle, a bias that must be below the noise
    mixing = np.trace(expected[3:, 3:])
    assert mixing < np.sqrt(2 / worlds)
    np.testing.assert_allclose(got, expected / np.outer(root, root), atol=SIGMAS * np.sqrt(2 / worlds) + mixing)


def rotation_vectors(now: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(W, 3) rotation vectors in world axes that lead from `start` to each of `now`."""
    out = []
    for q in now:
        turn = matrix(q) @ matrix(start).T
        axial = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        sine = np.linalg.norm(axial)
        out.append(axial * (np.arcsin(min(1.0, sine)) / sine if sine > 0 else 1.0))
    return np.array(out)


@pytest.mark.thorough
def test_free_diffusion(device):
    """4000 worlds: standard error 2.2 %, of which five are allowed; the six components and all their correlations."""
    check_diffusion(4000, 20, device, seed=3)


@pytest.mark.validate
def test_free_diffusion_precisely(device):
    """100 000 worlds: standard error 0.45 %."""
    check_diffusion(100_000, 4, device, seed=4)


def test_orientation_forgets_itself(device):
    """⟨cos θ⟩ of a dimer's axis decays as exp(−2 D_r t) over times in which it turns by radians.

    Standard error of a mean cosine: its standard deviation over √W, at most 1.6 % at W = 4000.
    """
    scene = Scene(bodies=(robot("A", shape=DIMER), sphere_body("Bead", (9.0, 0, 0))), settings=Settings(time_step=2e-2))
    sim = Simulation(scene, worlds=4000, seed=9, device=device)
    rotation = ENERGY / VISCOSITY * sim.model.data.body.mobility.numpy()[0][4, 4]
    steps = int(0.7 / (2 * rotation) / sim.time_step)
    sim.step(steps)
    q = sim.state.orientation.numpy().astype(float)[:, 0]
    x_axis = 1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2)  # first element of the rotation matrix
    expected = np.exp(-2 * rotation * steps * sim.time_step)
    # per-step angles of √(2 D dt) leave a bias of order (D dt)², far below the error
    assert x_axis.mean() == pytest.approx(expected, abs=SIGMAS * x_axis.std() / np.sqrt(4000))


DIMER = (((-1.2, 0.0, 0.0), 1.0), ((1.2, 0.0, 0.0), 1.0))


def check_dimer(worlds: int, samples: int, device: str, seed: int) -> None:
    """Equipartition of a dimer whose two spheres sit in two traps at their places.

    About small angles θ_y, θ_z the traps are a spring k L²/2 (two arms of L/2), so ⟨θ²⟩ = kT/(k L²/2), and for the
    translation ⟨x²⟩ = kT/2k; both times what Heun's scheme makes of it with the mode's own h. θ_x has no spring.
    """
    half = DIMER[1][0][0]
    # cut off between the spheres, so that each trap holds its own
    traps = tuple(harmonic(name, (x, 0, 0), cutoff=1.0) for name, x in (("T0", -half), ("T1", half)))
    scene = Scene(bodies=(robot("Dimer", shape=DIMER),), traps=traps, settings=Settings(accuracy=0.05))
    sim = Simulation(scene, worlds=worlds, seed=seed, device=device)
    dt, mobility = sim.time_step, sim.model.data.body.mobility.numpy()[0] / VISCOSITY
    sim.step(3000)
    x, sine = [], []
    every = 40
    for _ in range(samples):
        sim.step(every)
        x.append(sim.state.position.numpy().astype(float)[:, 0])
        q = sim.state.orientation.numpy().astype(float)[:, 0]
        axis = np.stack([2 * (q[:, 0] * q[:, 1] + q[:, 2] * q[:, 3]), 2 * (q[:, 0] * q[:, 2] - q[:, 1] * q[:, 3])], -1)
        sine.append(axis)
    assert np.all(sim.readout.escape_step.numpy() == -1)
    x, sine = np.array(x), np.array(sine)
    stiff = np.array([2 * STIFFNESS] * 3)
    h = stiff * np.diag(mobility)[:3] * dt
    exact = ENERGY / stiff * np.array([HEUN.variance(z) for z in h])
    error = SIGMAS * variance_error(worlds, samples, HEUN.decay(h.min()) ** every)
    np.testing.assert_allclose((x**2).mean(axis=(0, 1)), exact, rtol=error)
    torsion = 2 * STIFFNESS * half**2
    h_turn = torsion * mobility[4, 4] * dt
    exact_turn = ENERGY / torsion * HEUN.variance(h_turn)
    error = SIGMAS * variance_error(worlds, samples, HEUN.decay(h_turn) ** every)
    # sin²θ instead of θ², and anharmonic terms of the same order: relative 3⟨θ²⟩ at most
    assert 3 * exact_turn < 0.2 * error
    np.testing.assert_allclose((sine**2).mean(axis=(0, 1)), exact_turn, rtol=error)


@pytest.mark.thorough
def test_equipartition_of_a_dimer(device):
    """300 worlds, 60 samples with φ below 0.5: standard error 1.4 %."""
    check_dimer(300, 60, device, seed=21)


@pytest.mark.validate
def test_equipartition_of_a_dimer_precisely(device):
    """4000 worlds, 200 samples: standard error 0.2 %."""
    check_dimer(4000, 200, device, seed=22)
