"""What is looked at as a contact in a step, before it touches."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.kernels.drivers.grid.reach import PUSHED
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import obstacle, sphere_body
from tests.simulation.test_contact_chains import still

RADIUS = 1.0


@pytest.mark.thorough
def test_an_obstacle_is_looked_at_from_as_far_as_a_step_may_go(monkeypatch, device):
    """Beads at rest above a floor, apart from each other: those have a contact that a push may bring down to it.

    Launch by launch; where a block has the world to itself such contacts are added once something pushes.
    """
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    gap = np.linspace(0.01, 0.3, 30)
    where = [(4.0 * (i % 6), 4.0 * (i // 6), RADIUS + g) for i, g in enumerate(gap)]
    beads = tuple(sphere_body(f"B{i}", p, collides=True, density=2000e-12) for i, p in enumerate(where))
    sim = Simulation(still(beads, 1e-5, (), obstacle("Floor", "plane", (0, 0, 0))), device=device)
    count = sim._stepper.scratch.count  # pyright: ignore[reportAttributeAccessIssue]
    sim.step()
    # a bead falls by less than a nanometre in such a step
    np.testing.assert_array_equal(count.numpy()[0], gap < float(PUSHED) * RADIUS)
