"""Contacts of many bodies: with each other and with the floor."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import obstacle, sphere_body
from tests.simulation.test_contact_chains import still


@pytest.mark.thorough
def test_a_heap_of_silica_settles(device):
    """30 beads fall on the floor and on each other at the longest step: none is thrown, none sinks in."""
    rng = np.random.default_rng(1)
    places = np.array([(i % 4, i // 4 % 4, i // 16) for i in range(30)]) * 2.3 + rng.uniform(-0.1, 0.1, (30, 3))
    places[:, 2] += 1.2
    beads = tuple(sphere_body(f"B{i}", tuple(p), collides=True, density=2000e-12) for i, p in enumerate(places))
    sim = Simulation(still(beads, 1 / 60, (), obstacle("Floor", "plane", (0, 0, 0))), device=device)
    assert sim.model.features.driver == "grid"
    sim.run(2.0)
    place = sim.state.position.numpy()[0].astype(float)
    assert place[:, 2].min() > 0.95
    assert place[:, 2].max() < 3.6
    between = np.linalg.norm(place[:, None] - place[None], axis=2) + 9.0 * np.eye(30)
    assert between.min() > 1.95
