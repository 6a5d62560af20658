"""Worlds of some hundred bodies in phases against a block of threads for each."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core.features import world_lanes
from otwarp.kernels.drivers.grid.phases import TEAM_BLOCK, make_settle
from otwarp.kernels.step import make_step
from otwarp.simulation.drivers.block_stepper import BlockStepper
from otwarp.simulation.drivers.grid_phases_stepper import TEAM_LANES, GridPhasesStepper, places_for
from otwarp.simulation.drivers.stepping import StepperParts
from otwarp.simulation.drivers.world_scratch import many_in_phases
from otwarp.simulation.simulation import Simulation
from tests.kernels.drivers.grid.test_turns import jostling
from tests.kernels.drivers.grid.test_world import with_robot

WORLDS = 5

ROUNDED = 2e-5
"""Places and forces of equal steps in kernels of a GPU [µm, pN], whose compiler fuses other multiplications in each."""


def stepped(make, *, phased: bool, device: str) -> dict[str, np.ndarray]:
    """Places [µm] and contact forces [pN] after forty steps in three calls."""
    sim = Simulation(make(), worlds=WORLDS, seed=31, device=device, allow_large_step=True)
    # noise in blocks is a CPU's alone
    step = make_step(dataclasses.replace(sim.model.features, phased=phased, lanes=False, blocks=False))
    parts = StepperParts(step, sim.model, sim.state, sim.control, sim.last_readout, threads=1)
    sim._stepper = (GridPhasesStepper if phased else BlockStepper)(parts)
    for steps in (1, 37, 2):
        sim.step(steps)
    assert int(sim._stepper.scratch.near.builds.numpy().max()) >= 1
    return {"place": sim.state.position.numpy(), "force": sim.readout.contact_force.numpy()}


@pytest.mark.thorough
@pytest.mark.parametrize("make", [jostling, with_robot])
def test_same_steps_however_launched(make, monkeypatch, device):
    """Graphs of one step and of sixteen give what one kernel gives for all of them, two stages and a robot included."""
    monkeypatch.setattr("otwarp.simulation.model.takes_turns", lambda *about: False)
    together, apart = (stepped(make, phased=phased, device=device) for phased in (False, True))
    for name, value in together.items():
        assert np.abs(value).max() > 0.01
        np.testing.assert_allclose(apart[name], value, rtol=0.0, atol=0.0 if device == "cpu" else ROUNDED)


@pytest.mark.thorough
def test_few_worlds_keep_to_one_kernel():
    """By the number of all worlds of a simulation, so that its shards agree."""
    features = dataclasses.replace(Simulation(with_robot(), device="cpu").model.features, in_turn=False)
    gpu: Any = SimpleNamespace(is_cuda=True, sm_count=132)
    for bodies, most in ((31, 1056), (128, 1056), (201, 528), (512, 264)):
        some = dataclasses.replace(features, bodies=bodies)
        assert [many_in_phases(some, worlds, gpu) for worlds in (1, most, most + 1)] == [False, False, True]
    assert not many_in_phases(features, 4_096, wp.get_device("cpu"))


def test_worlds_in_motion_are_launched_by_powers_of_two():
    assert [places_for(moving, 11) for moving in (None, 1, 2, 3, 4, 5, 8, 9, 11)] == [11, 1, 2, 4, 4, 8, 8, 11, 11]


def test_teams_are_launched_in_the_blocks_that_were_compiled():
    """Else Warp compiles the longest kernel of a step a second time, while a graph is captured."""
    features = dataclasses.replace(Simulation(with_robot(), device="cpu").model.features, in_turn=False)
    assert make_settle(features).module.options["block_dim"] == TEAM_BLOCK
    for worlds in (529, 1_024, 65_536):
        assert world_lanes(worlds, 132, least=TEAM_LANES) <= TEAM_BLOCK
