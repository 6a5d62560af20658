"""Free moves in the grid driver."""

from __future__ import annotations

import pytest

from otwarp import Simulation
from otwarp.scene import Scene, Settings
from tests.simulation.setups import ENERGY, drag, harmonic, neutral


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
