"""A rigid body whose mobility couples everything, held by three traps: equilibrium must not know the mobility, and the
way there must.

Traps of equal stiffness hold three corners of an L. For the Gibbs distribution on R³ × SO(3), with displacements and
rotations g_a of the body and −∂U/∂g_a = F_a its force or torque in world axes, ⟨F_a F_b⟩ = k_B T ⟨∂²U/∂g_a∂g_b⟩ (the
hypervirial theorem, Hirschfelder 1960, doi:10.1063/1.1731427), exactly and whatever M is. Detailed balance makes every
⟨F_a(0) F_b(t)⟩ symmetric; near equilibrium their decay is K e^(−MKt).
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.linalg import expm

from otwarp.hydrodynamics import BodyMobility
from otwarp.scene import Scene, Settings
from otwarp.simulation.packing.bodies import mobilities
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import ENERGY, STIFFNESS, VISCOSITY, harmonic, robot
from tests.validation import scheme
from tests.validation.laws import across_worlds, lagged
from tests.validation.poses import matrices, pose

CORNERS = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 2.0]])
SHAPE = tuple((tuple(c), r) for c, r in zip(CORNERS, (1.0, 1.3, 0.6), strict=True))
REACH = 1.4
"""Each trap reaches its own sphere (within 0.1 µm) and no other."""

H = 0.02
"""Fastest rate × time step."""


@functools.cache
def body() -> BodyMobility:
    """Mobility and centre of diffusion."""
    return mobilities(Scene(bodies=(robot("L", shape=SHAPE),)))[0]


def levers() -> np.ndarray:
    """(3, 3) the corners from the centre of diffusion [µm]."""
    return CORNERS - body().reference


def gradients(levers: np.ndarray) -> np.ndarray:
    """(..., 3, 3, 6) displacement of each corner per (Δx, Δθ), for levers (..., 3, 3) in world axes."""
    out = np.zeros((*levers.shape[:-2], 3, 3, 6))
    out[..., 0, 0] = out[..., 1, 1] = out[..., 2, 2] = 1.0
    # Δθ × r
    out[..., 3:] = np.cross(np.eye(3), levers[..., :, None, :]).swapaxes(-1, -2)
    return out


def stiffness() -> np.ndarray:
    """(6, 6) K at rest."""
    g = gradients(levers())
    return STIFFNESS * np.einsum("cia,cib->ab", g, g)


def rates() -> np.ndarray:
    """Relaxation rates, fastest last [1/s]."""
    mobility = body().mobility / VISCOSITY
    return np.sort(np.linalg.eigvals(mobility @ stiffness()).real)


def loads(sim: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """(W, 6) ∂U/∂g_a and (W, 6, 6) ∂²U/∂g_a∂g_b, symmetrized, over STIFFNESS, from the poses alone."""
    position, orientation = pose(sim)
    r = np.einsum("wij,cj->wci", matrices(orientation), levers())
    centre = CORNERS.mean(axis=0)
    d = position[:, None, :] + r - (CORNERS - centre)
    g = gradients(r)
    slope = np.einsum("wcia,wci->wa", g, d)
    curvature = np.einsum("wcia,wcib->wab", g, g)
    # second order of the rotation: ½(θ_a θ·r − θ² r), symmetrized
    bend = 0.5 * (np.einsum("wca,wcb->wab", d, r) + np.einsum("wca,wcb->wab", r, d))
    curvature[:, 3:, 3:] += bend - np.einsum("wci,wci->w", d, r)[:, None, None] * np.eye(3)
    return slope, curvature


def scene() -> Scene:
    centre = CORNERS.mean(axis=0)
    traps = tuple(
        harmonic(f"T{i}", tuple(c - centre), cutoff=REACH, holds=f"/World/L/S{i}") for i, c in enumerate(CORNERS)
    )
    return Scene(
        bodies=(robot("L", tuple(-centre), shape=SHAPE),),
        traps=traps,
        settings=Settings(time_step=H / float(rates()[-1])),
    )


def test_the_body_is_strongly_coupled():
    """Modes of M K are not those of K: the mobility mixes them by more than 10 %."""
    values, modes = np.linalg.eigh(stiffness())
    mobility = body().mobility
    scaled = modes.T @ mobility @ modes
    root = np.sqrt(np.diag(scaled))
    assert values.min() > 0.0
    assert np.abs(scaled / np.outer(root, root) - np.eye(6)).max() > 0.1


def check(expect_law, device: str, worlds: int, samples: int) -> None:
    sim = Simulation(scene(), worlds=worlds, seed=121, device=device)
    slow = float(rates()[0])
    interval = 0.25 / slow
    every = max(1, round(interval / sim.time_step))
    sim.step(24 * every)
    slope, curvature = [], np.zeros((worlds, 6, 6))
    for _ in range(samples):
        sim.step(every)
        one, two = loads(sim)
        slope.append(one)
        curvature += two / samples
    assert np.all(sim.readout.escape_step.numpy() < 0)
    f = np.array(slope)
    root = np.sqrt(np.diag(stiffness()) / STIFFNESS * ENERGY / STIFFNESS)
    f /= root
    curvature = curvature * ENERGY / STIFFNESS / np.outer(root, root)
    square = lagged(f, f, 0)
    mean, error = across_worlds(square - curvature)
    # what the step makes of the variance of the fastest mode, and the square of angles of 0.03 rad
    bias = abs(scheme.variance(scheme.DEFAULT, H) - 1.0) + 2e-3
    diagonal = np.eye(6, dtype=bool)
    own = curvature.mean(axis=0)[diagonal]
    name = "equipartition: ⟨F_a²⟩/k_B T⟨∂²U/∂g_a²⟩"
    expect_law(name, 1.0 + mean[diagonal] / own, 1.0, error[diagonal] / own, bias=bias)
    expect_law("⟨F_a F_b⟩ − k_B T⟨∂²U/∂g_a∂g_b⟩, a ≠ b", mean[~diagonal], 0.0, error[~diagonal], bias=bias)
    k = stiffness() / STIFFNESS * ENERGY / STIFFNESS / np.outer(root, root)
    decay = body().mobility / VISCOSITY @ stiffness()
    upper = np.triu_indices(6, 1)
    for lag in (1, 4):
        later = lagged(f, f, lag)
        mean, error = across_worlds((later - later.transpose(0, 2, 1))[:, upper[0], upper[1]])
        expect_law(f"detailed balance: ⟨F_a(0)F_b(t)⟩ − ⟨F_b(0)F_a(t)⟩ at κt = {0.25 * lag:g}", mean, 0.0, error)
        time = lag * every * sim.time_step
        # F = K q, so that ⟨F(0) Fᵀ(t)⟩ = k_B T (K e^(−MKt))ᵀ
        raw = stiffness() @ expm(-decay * time) * ENERGY / STIFFNESS**2 / np.outer(root, root)
        mean, error = across_worlds(later)
        # angles of 0.03 rad make the law linear to their square
        expect_law(
            f"⟨F_a(0)F_b(t)⟩ = k_B T K e^(−MKt) at κt = {0.25 * lag:g}", mean, raw.T, error, bias=bias * np.abs(k).max()
        )


def test_rigid_body_in_three_traps(expect_law, device):
    """Equipartition, detailed balance and relaxation of an L-shaped body.

    Source: Hirschfelder 1960, doi:10.1063/1.1731427; Onsager 1931, doi:10.1103/PhysRev.37.405.
    """
    check(expect_law, device, 1000, 40)


@pytest.mark.validate
def test_rigid_body_in_three_traps_precisely(expect_law, device):
    """Equipartition, detailed balance and relaxation of an L-shaped body.

    Source: Hirschfelder 1960, doi:10.1063/1.1731427; Onsager 1931, doi:10.1103/PhysRev.37.405.
    """
    check(expect_law, device, 4000, 160)
