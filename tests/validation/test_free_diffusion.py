"""Free diffusion of a sphere, a touching dimer and robots of five spheres: 2 k_B T M t in the body's frame, and in the
laboratory as the orientation is forgotten.

About the centre of diffusion the drift of the position vanishes, so displacements of different times are uncorrelated
and ⟨Δx Δxᵀ⟩ = 2 ∫⟨D(s)⟩ds, where D(s) = R D Rᵀ turns with the body. ⟨R A Rᵀ⟩ obeys a linear equation, whose solution
is exact for any rotation tensor (Perrin 1934, doi:10.1051/jphysrad:01934005010049700; Brenner 1967,
doi:10.1016/0021-9797(67)90185-3; seen in the microscope by Han et al. 2006, doi:10.1126/science.1130146).
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm

from otwarp.scene import Body, Scene, Settings
from otwarp.simulation.packing.bodies import mobilities
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import ENERGY, FIVE, VISCOSITY, drag, robot, sphere_body
from tests.validation.laws import Law, across_worlds
from tests.validation.poses import matrices, pose, turns

TOUCHING = (((0.0, 0.0, -1.0), 1.0), ((0.0, 0.0, 1.0), 1.0))
SHAPES = {"touching dimer": TOUCHING, "five-element robot": FIVE, "propeller": FIVE}
PROPELLER = np.diag([0.02, 0.025, 0.03, 0.008, 0.01, 0.012])
PROPELLER[:3, 3:] = PROPELLER[3:, :3] = 1e-3 * np.array([[8.0, 2.0, 0.0], [2.0, -7.0, 1.0], [0.0, 1.0, 5.0]])
"""A given mobility about its centre of diffusion that couples force and rotation by up to 63 % of √(M_t M_r)."""

TURN = tuple(np.array([0.5, -0.1, 0.3, 0.8]) / np.linalg.norm([0.5, -0.1, 0.3, 0.8]))


def body(name: str) -> Body:
    one = robot("Robot", orientation=TURN, shape=SHAPES[name])
    return dataclasses.replace(one, mobility=tuple(PROPELLER.ravel())) if name == "propeller" else one


def diffusion(name: str) -> np.ndarray:
    """(6, 6) k_B T M/η about the centre of diffusion [µm²/s, µm/s, 1/s]."""
    if name == "propeller":
        return ENERGY / VISCOSITY * PROPELLER
    return ENERGY / VISCOSITY * mobilities(Scene(bodies=(body(name),)))[0].mobility


def scene(name: str, time_step: float) -> Scene:
    return Scene(bodies=(body(name),), settings=Settings(time_step=time_step))


def check_sphere(expect_law: Law, device: str, worlds: int) -> None:
    sim = Simulation(
        Scene(bodies=(sphere_body("Bead"),), settings=Settings(time_step=1e-3)), worlds=worlds, seed=31, device=device
    )
    sim.step(50)
    x = sim.state.position.numpy()[:, 0].astype(float)
    got = x.T @ x / worlds
    expected = 2.0 * ENERGY / drag(1.0) * 50 * sim.time_step
    error = expected * np.sqrt((1.0 + np.eye(3)) / worlds)
    expect_law.tensor("sphere: ⟨Δx_i Δx_j⟩ [µm²]", got, expected * np.eye(3), error)


def test_sphere(expect_law, device):
    """⟨Δx_i Δx_j⟩ = 2 k_B T/(6πηa) t δ_ij.

    Source: Einstein 1905, doi:10.1002/andp.19053220806.
    """
    check_sphere(expect_law, device, 20_000)


@pytest.mark.validate
def test_sphere_precisely(expect_law, device):
    """⟨Δx_i Δx_j⟩ = 2 k_B T/(6πηa) t δ_ij.

    Source: Einstein 1905, doi:10.1002/andp.19053220806.
    """
    check_sphere(expect_law, device, 1_000_000)


def check_body_frame(expect_law: Law, name: str, device: str, worlds: int, intervals: int) -> None:
    d = diffusion(name)
    interval = 4
    dt = 1e-3 / np.trace(d[3:, 3:]) / interval
    sim = Simulation(scene(name, dt), worlds=worlds, seed=50 + list(SHAPES).index(name), device=device)
    total = np.zeros((6, 6))
    for _ in range(intervals):
        x, q = pose(sim)
        sim.step(interval)
        y, now = pose(sim)
        six = np.concatenate([np.einsum("wji,wj->wi", matrices(q), y - x), turns(now, q)], axis=1)
        total += six.T @ six
        sim.set_state(position=np.zeros((worlds, 1, 3)))  # float32 resolves small steps near the origin
    expected = 2.0 * d * interval * dt
    root = np.sqrt(np.diag(expected))
    scale = np.outer(root, root)
    found, exact = total / (worlds * intervals) / scale, expected / scale
    error = np.sqrt((1.0 + exact**2) / (worlds * intervals))
    # while the body turns by a mean square angle of 2·10⁻³, its axes mix by no more than that
    expect_law.tensor(f"{name}: ⟨ΔX_i ΔX_j⟩/√(2D_ii t·2D_jj t), 6×6", found, exact, error, bias=2.0e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_body_frame(expect_law, device, name):
    """⟨ΔX ΔXᵀ⟩ = 2 k_B T M t for short times, ΔX = (Δx, Δθ) in the body's axes.

    Source: Brenner 1967, doi:10.1016/0021-9797(67)90185-3.
    """
    check_body_frame(expect_law, name, device, 10_000, 2)


@pytest.mark.validate
@pytest.mark.parametrize("name", SHAPES)
def test_body_frame_precisely(expect_law, device, name):
    """⟨ΔX ΔXᵀ⟩ = 2 k_B T M t for short times, ΔX = (Δx, Δθ) in the body's axes.

    Source: Brenner 1967, doi:10.1016/0021-9797(67)90185-3.
    """
    check_body_frame(expect_law, name, device, 50_000, 20)


E_X = np.array(
    [[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 0.0]]]
)


def forgetting(rotation: np.ndarray) -> np.ndarray:
    """(9, 9) 𝓛 with d⟨R A Rᵀ⟩/dt = ⟨R (𝓛A) Rᵀ⟩ for rotational diffusion with the tensor `rotation` in body axes.

    Second order of exp(K) A exp(−K) with ⟨θ_a θ_b⟩ = 2 D_ab t: 𝓛A = Σ D_ab (E_a E_b A + A E_a E_b − 2 E_a A E_b).
    """
    out = np.zeros((9, 9))
    eye = np.eye(3)
    for a in range(3):
        for b in range(3):
            ab = E_X[a] @ E_X[b]
            both = np.kron(ab, eye) + np.kron(eye, ab.T) - 2.0 * np.kron(E_X[a], E_X[b].T)
            out += rotation[a, b] * both
    return out


def spread(d: np.ndarray, start: np.ndarray, time: float) -> np.ndarray:
    """(3, 3) ⟨Δx Δxᵀ⟩ in the laboratory after `time`, from the orientation `start` (3, 3)."""
    operator = forgetting(d[3:, 3:])
    # ∫ exp(𝓛s) ds applied to D_tt, through the exponential of a block matrix (𝓛 has no inverse: isotropy stays)
    block = np.zeros((18, 18))
    block[:9, :9], block[:9, 9:] = operator, np.eye(9)
    integral = expm(block * time)[:9, 9:]
    return 2.0 * start @ (integral @ d[:3, :3].ravel()).reshape(3, 3) @ start.T


def test_forgetting_of_a_dimer_is_the_known_exponential():
    """For an axis of symmetry the deviation from isotropy decays with 6 D_r."""
    d = diffusion("touching dimer")
    axis = np.diag([0.0, 0.0, 1.0]) - np.eye(3) / 3.0
    got = forgetting(d[3:, 3:]) @ axis.ravel()
    np.testing.assert_allclose(got, -6.0 * d[3, 3] * axis.ravel(), atol=1e-12 * d[5, 5])


FROZEN = 8e-3
"""tr D_r·dt: the orientation is frozen during a step, which leaves this fraction of the anisotropic part at most."""


def check_laboratory(expect_law: Law, name: str, device: str, worlds: int) -> None:
    d = diffusion(name)
    slow = np.linalg.eigvalsh(d[3:, 3:]).min()
    dt = FROZEN / np.trace(d[3:, 3:])
    sim = Simulation(scene(name, dt), worlds=worlds, seed=40 + list(SHAPES).index(name), device=device)
    first, _ = pose(sim)
    start = matrices(np.array(TURN))
    for time in (0.05 / slow, 0.3 / slow, 1.5 / slow):
        sim.step(round(time / dt) - sim.state.step)
        moved = pose(sim)[0] - first
        got, error = across_worlds(moved[:, :, None] * moved[:, None, :])
        expected = spread(d, start, sim.time)
        anisotropy = np.ptp(np.linalg.eigvalsh(d[:3, :3])) / d[0, 0]
        bias = FROZEN * anisotropy * expected.max()
        expect_law.tensor(
            f"{name}: ⟨Δx_i Δx_j⟩ at t = {slow * sim.time:.2f}/D_r [µm²]", got, expected, error, bias=bias
        )
    isotropic = 2.0 * np.trace(d[:3, :3]) / 3.0 * sim.time
    mean, error = across_worlds((moved**2).mean(axis=1))
    expect_law(f"{name}: ⟨Δx²⟩/3 against 2 D̄ t, D̄ = tr D/3 [µm²]", mean, isotropic, error)


@pytest.mark.parametrize("name", ["touching dimer"])
def test_laboratory_frame(expect_law, device, name):
    """⟨Δx Δxᵀ⟩ = 2∫⟨R D Rᵀ⟩ds in the laboratory, isotropic in the long run.

    Source: Perrin 1934, doi:10.1051/jphysrad:01934005010049700.
    """
    check_laboratory(expect_law, name, device, 3000)


@pytest.mark.validate
@pytest.mark.parametrize("name", SHAPES)
def test_laboratory_frame_precisely(expect_law, device, name):
    """⟨Δx Δxᵀ⟩ = 2∫⟨R D Rᵀ⟩ds in the laboratory, isotropic in the long run.

    Source: Perrin 1934, doi:10.1051/jphysrad:01934005010049700.
    """
    check_laboratory(expect_law, name, device, 40_000)
