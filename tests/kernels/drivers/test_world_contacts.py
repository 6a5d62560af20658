"""Contacts of a world of few bodies, found and reported."""

from __future__ import annotations

import numpy as np

from otwarp.simulation.simulation import Simulation
from tests.simulation.test_determinism import touching_scene


def test_net_force_and_load_of_two_cells(device):
    """Two cells pressed together above a floor: across it equal and opposite forces, no larger than the loads."""
    sim = Simulation(touching_scene(), worlds=8, seed=31, device=device)
    sim.step(50)
    force, load = (a.numpy().astype(float) for a in (sim.readout.contact_force, sim.readout.contact_load))
    assert np.abs(force[..., 0]).max() > 0.01
    np.testing.assert_allclose(force[..., :2].sum(axis=1), 0.0, atol=1e-6)
    assert np.all(force[..., 2].sum(axis=1) >= -1e-6)
    assert np.all(np.linalg.norm(force, axis=-1) <= load + 1e-6)
