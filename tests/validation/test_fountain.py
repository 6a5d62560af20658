"""The fountain of probability: optical forces are no gradient, so the steady state in a tweezer carries a current.

Roichman, Sun, Stolarski & Grier 2008, doi:10.1103/PhysRevLett.101.128301. The tabulated force of a real beam on a glass
bead, in a weak trap where thermal motion is wide, against the Smoluchowski equation in (ρ, z) with the same table by
finite volumes. The current is counted as the net number of passages between four rooms around the centre of the roll
(near the axis or far from it, low or high), and as the odd part of ⟨δρ²(0) δz(t)⟩; Boltzmann's state has neither.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from otwarp.optics import Beam, ForceTable, Particle, build_table
from otwarp.scene import Body, Scene, Settings, Sphere, Track, Trap
from otwarp.simulation.simulation import Simulation
from tests.reference.fokker_planck import Swarm, cylinder
from tests.simulation.setups import ENERGY, drag
from tests.validation import scheme
from tests.validation.laws import Law, across_worlds, lagged

RADIUS, INDEX = 0.5, 1.45
POWER = 0.35
"""mW: a well of 24 k_B T, 90 nm wide across the beam: no bead is lost during the run."""

STEP = 0.01
"""κ_r·dt."""
LAG = 0.5
"""Time between samples over the relaxation time 1/κ_r."""
BIAS = 4.0 * abs(scheme.variance(scheme.DEFAULT, STEP) - 1.0) + 0.01
"""Relative: the time step on moments of at most fourth order, and the grid of the finite volumes."""


GRID = 0.01
"""Relative change of the solution when the cells are halved; the error that is left is a third of it."""


def table() -> ForceTable:
    sphere = Particle(radius=RADIUS, index=INDEX)
    return build_table(Beam(), sphere, tolerance=1e-3, interpolation="bicubic")


def swarm(cells: int, gradient_only: bool = False) -> Swarm:
    """Solution in 0 < ρ < 6σ and 5σ below to 7σ above the equilibrium."""
    held = table()
    assert held.properties is not None
    scale = held.beam.force_scale * POWER
    stiffness = POWER * np.array(held.properties.stiffness)
    width, centre = np.sqrt(ENERGY / stiffness), held.properties.equilibrium

    def field(rho: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if gradient_only:
            return -stiffness[0] * rho * np.cos(z - centre), 0.5 * stiffness[0] * rho**2 * np.sin(
                z - centre
            ) - stiffness[2] * (z - centre)
        force = held.force(np.stack([rho, 0.0 * rho, z], axis=1)) * scale
        return force[:, 0], force[:, 2]

    rho = np.linspace(0.0, 6.0 * width[0], cells + 1)
    z = np.linspace(centre - 5.0 * width[2], centre + 7.0 * width[2], 2 * cells + 1)
    return cylinder(field, rho, z, diffusion=ENERGY / drag(RADIUS), energy=ENERGY)


def rate() -> float:
    """κ_r [1/s]."""
    held = table().properties
    assert held is not None
    return POWER * held.stiffness[0] / drag(RADIUS)


def borders() -> tuple[float, float]:
    """(ρ, z) where the four rooms meet [µm], on faces of the coarse and the fine grid: 1.5σ out, σ/2 up."""
    held = table().properties
    assert held is not None
    width = np.sqrt(ENERGY / (POWER * np.array(held.stiffness)))
    return 1.5 * width[0], held.equilibrium + width[2] * (12.0 * 22.0 / 48.0 - 5.0)


def rooms(rho: np.ndarray, z: np.ndarray) -> np.ndarray:
    """0 near and low, 1 near and high, 2 far and high, 3 far and low: in the order of the roll."""
    edge, middle = borders()
    far, high = rho >= edge, z >= middle
    return np.where(far, np.where(high, 2, 3), np.where(high, 1, 0))


def prediction(one: Swarm) -> dict[str, np.ndarray]:
    """What the solution says of the quantities that are measured."""
    m, time = one.stationary(), LAG / rate()
    s, z = one.first**2, one.second
    ds, dz = s - m @ s, z - m @ z
    room = rooms(one.first, z)
    start = np.stack([np.where(room == i, m, 0.0) for i in range(4)], axis=1)
    end = one.later(start, time)
    passages = np.stack([end[room == i].sum(axis=0) for i in range(4)], axis=1)
    return {
        "moments": np.array([m @ z, m @ s, m @ dz**2, m @ (ds * dz)]),
        "shares": start.sum(axis=0),
        "net": passages - passages.T,
        "odd": np.array(m @ (ds * one.later_mean(dz, time)) - m @ (dz * one.later_mean(ds, time))),
    }


@functools.cache
def expected() -> dict[str, np.ndarray]:
    """The solution on the fine grid."""
    return prediction(swarm(96))


@pytest.mark.thorough
def test_the_solution_has_converged():
    """Half as many cells along ρ and z change it by 1 % at most; the errors are of second order."""
    coarse, fine = prediction(swarm(48)), expected()
    np.testing.assert_allclose(coarse["moments"], fine["moments"], rtol=GRID)
    np.testing.assert_allclose(coarse["net"], fine["net"], atol=GRID * np.abs(fine["net"]).max())
    np.testing.assert_allclose(coarse["odd"], fine["odd"], rtol=GRID)


@pytest.mark.thorough
def test_a_gradient_has_no_current():
    """The same solver and rooms see nothing where the force is conservative."""
    still, roll = prediction(swarm(48, gradient_only=True)), expected()
    assert np.abs(still["net"]).max() < 1e-3 * np.abs(roll["net"]).max()
    assert abs(still["odd"]) < 1e-3 * abs(roll["odd"])


def run(device: str, worlds: int, samples: int) -> np.ndarray:
    """(samples, W, 3) positions, LAG apart."""
    bead = Body(prim="/World/B", spheres=(Sphere(prim="/World/B/s", radius=RADIUS, refractive_index=INDEX),))
    trap = Trap(
        prim="/World/T",
        position=Track.constant((0.0, 0.0, 0.0)),
        power=Track.constant(POWER),
        model="table",
        tolerance=1e-3,
        interpolation="bicubic",
    )
    scene = Scene(bodies=(bead,), traps=(trap,), settings=Settings(time_step=STEP / rate()))
    sim = Simulation(scene, worlds=worlds, seed=72, device=device)
    every = round(LAG / STEP)
    sim.step(24 * every)
    out = np.empty((samples, worlds, 3), dtype=np.float32)
    for i in range(samples):
        sim.step(every)
        out[i] = sim.state.position.numpy()[:, 0]
    assert np.all(sim.readout.escape_step.numpy() < 0)
    return out.astype(float)


def check(expect_law: Law, x: np.ndarray, seen: float) -> None:
    exact = expected()
    rho, z = np.hypot(x[..., 0], x[..., 1]), x[..., 2]
    mean_z, mean_s = exact["moments"][:2]
    ds, dz = rho**2 - mean_s, z - mean_z
    for name, values, value in zip(
        ("⟨z⟩ [µm]", "⟨ρ²⟩ [µm²]", "var z [µm²]", "cov(ρ², z) [µm³]"),
        (z, rho**2, dz**2, ds * dz),
        exact["moments"],
        strict=True,
    ):
        mean, error = across_worlds(values.mean(axis=0))
        expect_law(name, mean, value, error, bias=BIAS * abs(value))
    room = rooms(rho, z)
    here = np.stack([room == i for i in range(4)], axis=-1).astype(np.float32)
    mean, error = across_worlds(here.mean(axis=0))
    expect_law("share of time in four rooms", mean, exact["shares"], error, bias=BIAS * exact["shares"] / 2)
    passages = lagged(here, here, 1)
    net = (passages - passages.transpose(0, 2, 1))[:, (0, 1, 2, 3), (1, 2, 3, 0)]
    mean, error = across_worlds(net)
    roll = exact["net"][(0, 1, 2, 3), (1, 2, 3, 0)]
    assert np.abs(roll).min() > seen * error.max(), "the roll must be seen"
    expect_law("net passages per sample around the roll", mean, roll, error, bias=BIAS * np.abs(roll))
    one, other = lagged(ds[..., None], dz[..., None], 1), lagged(dz[..., None], ds[..., None], 1)
    mean, error = across_worlds((one - other)[:, 0, 0])
    assert abs(exact["odd"]) > seen * error, "the current must be seen"
    expect_law("odd part of ⟨δρ²(0) δz(t)⟩ [µm³]", mean, exact["odd"], error, bias=BIAS * abs(exact["odd"]))


@pytest.mark.validate
def test_fountain(expect_law, device):
    """Steady state and toroidal current of a bead in the tabulated force of a focused beam.

    Source: Roichman, Sun, Stolarski & Grier 2008, doi:10.1103/PhysRevLett.101.128301.
    """
    check(expect_law, run(device, 8000, 800), seen=10.0)
