"""Slots on a CPU against one sphere after the other: the same places but for the rounding of sums."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.step import make_step
from otwarp.simulation.drivers.grid_stepper import GridStepper
from otwarp.simulation.drivers.stepping import StepperParts
from tests.kernels.drivers.grid.test_soft import HOT, ROUNDING, packed, soft_simulation


@pytest.mark.thorough
@pytest.mark.cpu_forms
def test_places_are_those_of_one_sphere_after_the_other(device):
    """Two worlds of a packing that is listed anew several times; forces on a sphere are summed in another way."""
    if not wp.get_device(device).is_cpu:
        pytest.skip("the form for CPUs")
    places = []
    for lanes in (True, False):
        sim = soft_simulation(packed(temperature=HOT), worlds=2, seed=3, device=device)
        assert sim.model.features.lanes
        model = replace(sim.model, features=replace(sim.model.features, lanes=lanes))
        parts = StepperParts(make_step(model.features), model, sim.state, sim.control, sim.last_readout)
        stepper = GridStepper(parts)
        sim.model, sim._stepper = model, stepper
        sim.step(60)
        assert stepper.scratch.near.builds.numpy()[0] > 2
        places.append((sim.state.position.numpy(), sim.readout.contact_load.numpy()))
    for blocks, single in zip(*places, strict=True):
        np.testing.assert_allclose(blocks, single, rtol=0, atol=ROUNDING)
    assert np.count_nonzero(places[0][1]) > 10
