"""The world driver against the solo driver."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import harmonic
from tests.simulation.test_determinism import touching_scene


@pytest.mark.thorough
def test_solo_and_world_drivers_agree_without_contact(device):
    """The same beads that cannot collide (solo) and that could but are far apart (world): equal to a few roundings.

    Not bit for bit, because the compiler may fuse other multiplications in another kernel.
    """
    far = touching_scene()
    bodies = (far.bodies[0], dataclasses.replace(far.bodies[1], position=(60.0, 0, 9.0)))
    traps = (far.traps[0], harmonic("TB", (60.0, 0, 9.0), cutoff=1.5))
    bodies = (dataclasses.replace(bodies[0], position=(-1.6, 0, 9.0)), bodies[1])
    traps = (dataclasses.replace(harmonic("TA", (-1.6, 0, 9.0), cutoff=1.5)), traps[1])
    can = dataclasses.replace(far, bodies=bodies, traps=traps)
    ghosts = tuple(
        dataclasses.replace(b, spheres=tuple(dataclasses.replace(s, collides=False) for s in b.spheres)) for b in bodies
    )
    cannot = dataclasses.replace(can, bodies=ghosts)
    fused, solo = (Simulation(s, worlds=4, seed=8, device=device) for s in (can, cannot))
    assert (fused.model.features.driver, solo.model.features.driver) == ("world", "solo")
    for sim in (fused, solo):
        sim.step(400)
    np.testing.assert_allclose(fused.state.position.numpy(), solo.state.position.numpy(), atol=4e-5)
    moved = fused.state.position.numpy()[:, 0] - [-1.6, 0, 9.0]
    assert np.abs(moved).max() > 0.005
