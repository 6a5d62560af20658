"""A sphere and a dimer above a hydrodynamic wall: how fast they diffuse there, and where Boltzmann has them.

The mobility falls to nothing at the wall, and with it the distribution would follow 1/μ but for the thermal drift ∇·M.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from otwarp.hydrodynamics.bispherical import wall_resistance
from otwarp.laws.wall_fits import CONTACT_GAP, NORMAL
from otwarp.simulation.simulation import Simulation
from tests.simulation.test_walls import FIT, UNIT, dimer, heavy_bead, start_at, touching_bead

SHORT = 5e-3
"""Of the variance of a step: the square of its drift and the variance of the drift's factor, at 0.005 g²/D⊥."""


@pytest.mark.parametrize("gap", [0.02, 0.3, 3.0])
def test_diffusion_at_a_height(expect_law, device, gap):
    """⟨Δx²⟩ = 2D∥dt, ⟨Δz²⟩ = 2D⊥dt and ⟨Δz⟩ = D⊥' dt in one short step at gaps of 0.02, 0.3 and 3 radii.

    Source: O'Neill 1964, doi:10.1112/S0025579300003508; Brenner 1961, doi:10.1016/0009-2509(61)80035-3; the drift,
    Ermak & McCammon 1978, doi:10.1063/1.436761.
    """
    worlds = 40_000
    exact = wall_resistance(gap)
    step = 0.005 * gap**2 * exact.normal / UNIT
    sim = Simulation(heavy_bead(1e3, dt=step), worlds=worlds, seed=21, device=device, allow_large_step=True)
    start_at(sim, np.full(worlds, 1.0 + gap))
    before = sim.state.position.numpy().astype(float)
    sim.step()
    move = (sim.state.position.numpy() - before)[:, 0]
    variance = 2.0 * UNIT * step
    error = np.sqrt(2.0 / worlds)
    name = f"gap of {gap:g} radii"
    along = (move[:, :2] ** 2).mean() * exact.sliding / variance
    expect_law(f"{name}: D∥ over the exact one", along, 1.0, error / np.sqrt(2.0), bias=FIT)
    expect_law(
        f"{name}: D⊥ over the exact one", move[:, 2].var() * exact.normal / variance, 1.0, error, bias=FIT + SHORT
    )
    slope = (1.0 / wall_resistance(gap * 1.001).normal - 1.0 / wall_resistance(gap * 0.999).normal) / (0.002 * gap)
    drift = UNIT * step * (slope - 1e-3 / exact.normal)
    error = np.sqrt(variance / exact.normal / worlds)
    expect_law(f"{name}: ⟨Δz⟩/dt over D⊥'", move[:, 2].mean() / drift, 1.0, error / drift, bias=FIT)


def mean_gap(length: float, power: float) -> float:
    """Mean of the density e^{−g/length} μ⊥(g)^power above a wall."""

    def moment(n: int) -> float:
        def weight(g: float) -> float:
            return g**n * np.exp(-g / length) * (1.0 + float(NORMAL(g)[0])) ** -power

        inner = quad(weight, 0.0, CONTACT_GAP)[0] + quad(weight, CONTACT_GAP, 0.01 * length, limit=200)[0]
        return inner + quad(weight, 0.01 * length, 40.0 * length, limit=200)[0]

    return moment(1) / moment(0)


def check_heights(expect_law, name: str, sim: Simulation, length: float, bias: float) -> None:
    """Mean gap, and how many spheres are within 0.1 and 1 lengths of the wall, for independent worlds."""
    worlds = sim.model.worlds
    gap = sim.state.position.numpy()[:, 0, 2].astype(float) - 1.0
    expect_law(f"{name}: mean gap over k_B T/weight", gap.mean() / length, 1.0, 1.0 / np.sqrt(worlds), bias=bias)
    for part in (0.1, 1.0):
        share = 1.0 - np.exp(-part)
        error = np.sqrt(share * (1.0 - share) / worlds)
        inside = (gap < part * length).mean()
        expect_law(f"{name}: share within {part:g} k_B T/weight", inside, share, error, bias=2.0 * bias * share)


LENGTH = 0.2
"""k_B T/weight of the spheres [µm]: most are in the lubrication layer."""
RELAXATION = LENGTH**2 * wall_resistance(LENGTH).normal / UNIT
"""Of their heights [s]."""
LONG = 0.01
"""Of the mean gap, at steps three times as long as the chosen one."""


@pytest.mark.parametrize("integrator", ["heun", "eulerMaruyama"])
def test_heights_above_a_wall(expect_law, device, integrator):
    """Boltzmann's distribution of heights stays what it is over five relaxation times.

    Source: Gibbs–Boltzmann statistics, whatever the mobility; without the drift the density is e^{−g/ℓ}/μ⊥.
    """
    worlds = 10_000
    sim = Simulation(heavy_bead(LENGTH, dt=0.003 / UNIT), worlds=worlds, seed=22, device=device, integrator=integrator)
    start_at(sim, 1.0 + np.random.default_rng(1).exponential(LENGTH, worlds))
    sim.run(5.0 * RELAXATION)
    check_heights(expect_law, integrator, sim, LENGTH, LONG)
    # without the thermal drift the mean gap would be a sixth of what it is
    assert mean_gap(LENGTH, 0.0) == pytest.approx(LENGTH, rel=1e-6)
    assert mean_gap(LENGTH, -1.0) < 0.5 * LENGTH


@pytest.mark.validate
def test_heights_above_a_wall_precisely(expect_law, device):
    """From one height to Boltzmann's distribution with the chosen step.

    Source: Gibbs–Boltzmann statistics, whatever the mobility.
    """
    sim = Simulation(heavy_bead(LENGTH, dt=None), worlds=40_000, seed=23, device=device)
    assert sim.model.scales.chosen_by == "motion near hydrodynamic walls and wanted accuracy"
    sim.run(8.0 * RELAXATION)
    check_heights(expect_law, sim.model.features.integrator, sim, LENGTH, sim.scene.settings.accuracy / 2.0)


@pytest.mark.thorough
def test_heights_of_a_sphere_that_touches(expect_law, device):
    """The same with contact, by the driver of worlds.

    Source: Gibbs–Boltzmann statistics, whatever the mobility.
    """
    worlds = 3000
    sim = Simulation(touching_bead(0.003 / UNIT), worlds=worlds, seed=24, device=device)
    assert sim.model.features.driver == "world"
    start_at(sim, 1.0 + np.random.default_rng(2).exponential(LENGTH, worlds))
    sim.run(5.0 * RELAXATION)
    check_heights(expect_law, "with contact", sim, LENGTH, LONG)


def check_dimer(expect_law, sim: Simulation, length: float, bias: float) -> None:
    """Tilt and gap against their densities: both by quadrature, the gap independent of the tilt."""
    worlds = sim.model.worlds
    q = sim.state.orientation.numpy()[:, 0].astype(float)
    tilt = np.abs(1.0 - 2.0 * (q[:, 0] ** 2 + q[:, 1] ** 2))
    gap = sim.state.position.numpy()[:, 0, 2].astype(float) - tilt - 1.0
    norm = quad(lambda c: np.exp(-c / length), 0.0, 1.0)[0]
    first, second = (quad(lambda c, n=n: c**n * np.exp(-c / length), 0.0, 1.0)[0] / norm for n in (1, 2))
    spread, root = np.sqrt(second - first**2), np.sqrt(worlds)
    expect_law("⟨|cos θ|⟩ of a dimer", tilt.mean(), first, spread / root, bias=bias * first)
    expect_law("mean gap of a dimer over k_B T/weight", gap.mean() / length, 1.0, 1.0 / root, bias=bias)
    share = 1.0 - np.exp(-0.1)
    error = np.sqrt(share * (1.0 - share)) / root
    expect_law("share within 0.1 k_B T/weight", (gap < 0.1 * length).mean(), share, error, bias=2.0 * bias * share)
    correlation = ((tilt - first) * (gap - length)).mean() / (spread * length)
    expect_law("correlation of |cos θ| and the gap", correlation, 0.0, 1.0 / root, bias=bias)


def place_dimers(sim: Simulation, length: float, seed: int) -> None:
    """Put the dimers where Boltzmann has them: |cos θ| of density e^{−|cos θ|/length}, gaps of e^{−gap/length}."""
    rng, worlds = np.random.default_rng(seed), sim.model.worlds
    tilt = -length * np.log(1.0 - rng.uniform(size=worlds) * (1.0 - np.exp(-1.0 / length)))
    half = 0.5 * np.arccos(tilt)
    position, orientation = np.zeros((worlds, 1, 3)), np.zeros((worlds, 1, 4))
    position[:, 0, 2] = 1.0 + tilt + rng.exponential(length, worlds)
    orientation[:, 0, 0], orientation[:, 0, 3] = np.sin(half), np.cos(half)
    sim.set_state(position=position, orientation=orientation)


@pytest.mark.thorough
def test_dimer_above_a_wall(expect_law, device):
    """Tilts and heights stay Boltzmann's over a rotational relaxation time.

    Source: Gibbs–Boltzmann statistics by quadrature.
    """
    length = 0.5
    sim = Simulation(dimer(0.006 / UNIT, length=length), worlds=2500, seed=26, device=device)
    place_dimers(sim, length, 4)
    sim.run(1.5 / UNIT)
    check_dimer(expect_law, sim, length, 2.0 * LONG)


@pytest.mark.validate
def test_dimer_above_a_wall_precisely(expect_law, device):
    """Upright dimers fall over and settle to Boltzmann's tilts and heights.

    Source: Gibbs–Boltzmann statistics by quadrature.
    """
    length = 0.5
    sim = Simulation(dimer(0.0025 / UNIT, length=length), worlds=4000, seed=27, device=device)
    sim.run(8.0 / UNIT)
    check_dimer(expect_law, sim, length, LONG)
