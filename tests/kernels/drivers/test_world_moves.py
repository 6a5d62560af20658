"""The end of a step of a world, by itself: given moves are taken, unless one of them is a fault."""

import numpy as np
import pytest

from otwarp.kernels.core.faults import Fault
from tests.kernels.drivers.test_world_phases import WORLDS, stepped_as


@pytest.mark.parametrize("form", ["phases", "teams"])
def test_moves_are_taken_together_or_not_at_all(form, device):
    """Places are those before plus the moves; in a world where one move is no number nothing moves, and it is told."""
    sim = stepped_as(form, device)
    stepper, place = sim._stepper, sim.state.position.numpy().copy()
    bodies = place.shape[1]
    move = np.random.default_rng(4).normal(0.0, 0.1, (WORLDS, bodies, 3)).astype(np.float32)
    move[3, bodies - 1, 0] = np.nan
    stepper.scratch.linear.assign(move)
    stepper.scratch.angular.zero_()
    views = (sim.model.data, sim.control.data(), sim.state.data(), sim.last_readout.data())
    data = (*views, stepper.scratch, stepper.clock)
    stepper.launch(stepper.phases.finish, WORLDS * stepper.team, *data, 0)
    fault = sim.last_readout.fault.numpy()
    assert fault[3, bodies - 1] == Fault.NON_FINITE and (np.delete(fault, 3, axis=0) == 0).all()
    move[3] = 0.0
    np.testing.assert_array_equal(sim.state.position.numpy(), place + move)
