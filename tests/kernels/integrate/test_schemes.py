"""Steps of a bead in a spring: their mean is what the table of integrators says."""

import numpy as np
import pytest

from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.simulation.simulation import Simulation
from tests.simulation.setups import COLD, STIFFNESS, bead_scene, drag

STEPS = 8


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_spring_decays_as_the_table_says(integrator, device):
    """x after n steps is decayⁿ x₀, along each axis, at a step of k·dt = 0.4; noise is frozen out."""
    z = 0.4
    scene, cold = bead_scene(time_step=z * drag(1.0) / STIFFNESS), {"medium_temperature": COLD}
    sim = Simulation(scene, device=device, integrator=integrator, parameters=cold, allow_large_step=True)
    start = np.array([[0.3, -0.2, 0.1]])
    sim.set_state(position=start)
    sim.step(STEPS)
    expected = INTEGRATORS[integrator].decay(z) ** STEPS * start
    np.testing.assert_allclose(sim.state.position.numpy()[0], expected, atol=1e-6)
