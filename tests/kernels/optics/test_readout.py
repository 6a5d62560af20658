"""The readout of traps: its sums agree, whoever is asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from otwarp.scene import Scene
from otwarp.simulation.simulation import Simulation

SCENE = Path(__file__).parents[3] / "scenes" / "two_trap_dimer.usda"
ROUNDING = 1e-6
"""Of forces of some pN, each summed in another order."""


def test_forces_add_up_by_trap_by_sphere_and_by_hand(device):
    """Each hand of the dimer has one trap, which pulls its sphere back towards itself."""
    sim = Simulation(Scene.load(SCENE), worlds=3, seed=1, device=device)
    place = sim.state.position.numpy()
    sim.set_state(position=place + np.array([[[0.1, 0.0, 0.0]], [[0.0, -0.2, 0.1]], [[0.0, 0.0, 0.0]]]))
    found = sim.readout
    trap, sphere, hand = (a.numpy().astype(float) for a in (found.trap_force, found.sphere_force, found.hand_force))
    np.testing.assert_allclose(trap.sum(axis=1), sphere.sum(axis=1), atol=ROUNDING)
    np.testing.assert_allclose(hand, trap, atol=ROUNDING)
    assert np.all(trap[0, :, 0] < -0.1) and np.all(trap[1, :, 1] > 0.1)
    # a law pulls along the way to where it vanishes, and the distance is that way
    assert np.all(found.trap_distance.numpy()[:2] > 0.09)
    np.testing.assert_allclose(found.trap_power.numpy(), 5.0)
