"""The medium of a world: one row for all worlds, or one for each."""

import numpy as np
import warp as wp

from otwarp.kernels.core.medium import step_over_viscosity, thermal_energy_of, viscosity_of
from otwarp.kernels.core.types import ModelData


@wp.kernel(enable_backward=False)
def medium(model: ModelData, out: wp.array2d(dtype=float)):
    world = wp.tid()
    out[world, 0] = thermal_energy_of(model, world)
    out[world, 1] = viscosity_of(model, world)
    out[world, 2] = step_over_viscosity(model, world)


def test_a_world_has_the_medium_of_its_row(device):
    model = ModelData()
    model.time_step = 0.5
    model.medium.thermal_energy = wp.array([4.0], dtype=float, device=device)
    model.medium.viscosity = wp.array([1.0, 2.0], dtype=float, device=device)
    out = wp.zeros((2, 3), dtype=float, device=device)
    wp.launch(medium, dim=2, inputs=[model, out], device=device)
    np.testing.assert_array_equal(out.numpy(), [[4.0, 1.0, 0.5], [4.0, 2.0, 0.25]])
