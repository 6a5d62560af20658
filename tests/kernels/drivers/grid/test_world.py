"""Worlds that a block of threads has to itself against one launch after the other for all: the same bits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from otwarp.scene import Scene
from otwarp.simulation.block_stepper import BlockStepper
from otwarp.simulation.grid_stepper import GridStepper
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import robot
from tests.simulation.test_determinism import crowd_scene


def with_robot() -> Scene:
    """The heap of the crowd with a robot over it: contacts of bodies that turn, second stages and escapes."""
    base = crowd_scene()
    return dataclasses.replace(base, bodies=(*base.bodies, robot("R", (4.0, 2.0, 5.5), collides=True)))


def ended(scene: Scene, device: str, stepper: type, steps: int = 60) -> dict[str, np.ndarray]:
    """Two worlds after some steps in two calls."""
    sim = Simulation(scene, worlds=2, seed=4, device=device)
    assert isinstance(sim._stepper, stepper)
    for n in (steps // 3, steps - steps // 3):
        sim.step(n)
    return {
        "position": sim.state.position.numpy(),
        "orientation": sim.state.orientation.numpy(),
        "force": sim.readout.contact_force.numpy(),
        "load": sim.readout.contact_load.numpy(),
        "escape": sim.readout.escape_step.numpy(),
    }


@pytest.mark.thorough
@pytest.mark.parametrize("turns", [True, False])
@pytest.mark.parametrize("make", [crowd_scene, with_robot])
def test_a_world_by_itself_is_that_of_launches_for_all(make, turns, monkeypatch, device):
    """Contacts in turns and in sweeps, of lone spheres and of bodies that turn."""
    if not turns:
        monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    alone = ended(make(), device, BlockStepper)
    monkeypatch.setattr("otwarp.simulation.composition.GRID_WORLD_BODIES", 0)
    together = ended(make(), device, GridStepper)
    assert np.count_nonzero(alone["load"]) > 10
    for name, value in alone.items():
        np.testing.assert_array_equal(value, together[name], err_msg=name)
