"""Free moves in the grid driver."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp import Simulation
from otwarp.scene import Scene, Settings
from otwarp.simulation import composition
from tests.simulation.crowds import crowd, jumbled
from tests.simulation.setups import ENERGY, drag, harmonic, neutral, robot


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["leimkuhlerMatthews", "heun"])
def test_a_crowd_diffuses_as_it_should(integrator, device):
    """⟨Δx²⟩ = 2Dt of spheres that may touch and do not, whatever noise a scheme asks for and however it is drawn.

    40 spheres in 100 worlds: relative standard error √(2/12,000) = 1.3 %. Leimkuhler and Matthews lose half a step.
    """
    bodies = tuple(neutral(f"B{i}", (10.0 * i, 0.0, 0.0)) for i in range(40))
    steps = 20
    trap = harmonic("T", (0.0, 500.0, 0.0), cutoff=1.0)
    scene = Scene(bodies=bodies, traps=(trap,), settings=Settings(time_step=1e-4))
    sim = Simulation(scene, worlds=100, seed=8, device=device, integrator=integrator)
    assert sim.model.features.driver == "grid"
    start = sim.state.position.numpy().astype(float)
    sim.step(steps)
    moved = sim.state.position.numpy() - start
    shared = steps - 0.5 if integrator == "leimkuhlerMatthews" else steps
    expected = 2.0 * ENERGY / drag(1.0) * shared * sim.time_step
    assert (moved**2).mean() == pytest.approx(expected, rel=5.0 * (2.0 / 12_000) ** 0.5)


@pytest.mark.thorough
@pytest.mark.cpu_forms
def test_blocks_of_noise_change_no_bit(monkeypatch, device):
    """Of spheres in a channel beside a robot, with their noise 16 at a time and one by one; some touch."""
    if device != "cpu":
        pytest.skip("a CPU's form of the noise")
    base = crowd(jumbled(37, 2.2), temperature=298.15)
    bodies = (*base.bodies, robot("R", (-20.0, 0.0, 0.0), collides=True))
    scene = dataclasses.replace(base, bodies=bodies)
    found = []
    for blocks in (True, False):
        if not blocks:
            monkeypatch.setattr(composition, "_takes_blocks", lambda f: False)
        sim = Simulation(scene, worlds=2, seed=4, device=device, allow_large_step=True)
        assert sim.model.features.blocks == blocks
        sim.step(30)
        found.append((sim.state.position.numpy(), sim.state.orientation.numpy(), sim.readout.contact_load.numpy()))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.count_nonzero(found[0][2]) > 5
