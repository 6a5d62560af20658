"""Forces with parameters, measured at the present state: each in a row of its own."""

import numpy as np

from otwarp.simulation.simulation import Simulation
from tests.kernels.forces.setups import PUSH, by_size, scene, turning
from tests.simulation.setups import FIVE


def test_each_force_has_its_row(device):
    forces = [turning(strength={"/World/Robot": 0.7}), by_size(per_radius={"/World/Robot": 2.0})]
    sim = Simulation(scene(), worlds=2, device=device, forces=forces)
    assert [law.name for law in sim.model.features.forces] == ["external", "turning", "by_size"]
    expected = np.zeros((2, 3, 2, 3))
    expected[:, 0, 0] = PUSH
    expected[:, 2, 1, 2] = 2.0 * sum(radius for _, radius in FIVE)
    np.testing.assert_allclose(sim.readout.body_force.numpy(), expected, rtol=1e-6)
    np.testing.assert_allclose(sim.readout.body_torque.numpy()[:, 1, 1], [[0.0, 0.0, 0.7]] * 2, rtol=1e-6)
