"""One force of a model, asked for where the host wants it."""

import numpy as np
import warp as wp

from otwarp.kernels.forces.probe import make_force_probe
from otwarp.simulation.model import Model
from otwarp.simulation.options import StepOptions
from tests.kernels.forces.setups import ROUNDING, by_size, places, scene
from tests.kernels.samples import evaluate, on_device
from tests.reference.rotations import matrix
from tests.simulation.setups import FIVE, five_sphere_mobility


def probe(model: Model, index: int, b: int, world: np.ndarray, time: np.ndarray) -> list[np.ndarray]:
    """Force and torque of force `index` on body b at `places`."""
    position, rotation = places(len(world))
    device = str(model.device)
    inputs = on_device(
        device,
        (np.full(len(world), b), int),
        (world, int),
        (position, wp.vec3),
        (rotation, wp.quat),
        (time, wp.float64),
    )
    kernel = make_force_probe(model.features, index)
    return evaluate(kernel, len(world), [model.data, *inputs], [wp.vec3, wp.vec3], device)


def test_worlds_times_and_spheres(device):
    """Each sphere of the robot is pushed along z by its radius, twice as much in world 1, the more the later."""
    options = StepOptions(forces=(by_size(per_radius={"/World/Robot": 1.0}),))
    rows = {"by_size_per_radius": [[0.0, 1.0], [0.0, 2.0]]}
    model = Model.build(scene(), worlds=2, device=device, options=options, parameters=rows)
    index = [law.name for law in model.features.forces].index("by_size")
    world = np.arange(40) % 2
    time = np.linspace(0.0, 3.0, 40)
    force, torque = probe(model, index, 1, world, time)
    radii = np.array([radius for _, radius in FIVE])
    arms = np.array([offset for offset, _ in FIVE]) - five_sphere_mobility().reference
    pushes = ((1.0 + world) * (1.0 + time))[:, None, None] * radii[:, None] * [0.0, 0.0, 1.0]
    turned = np.array([arms @ matrix(q).T for q in places(40)[1]])
    np.testing.assert_allclose(force, pushes.sum(axis=1), rtol=ROUNDING)
    expected = np.cross(turned, pushes).sum(axis=1)
    np.testing.assert_allclose(torque, expected, atol=10.0 * ROUNDING * np.abs(pushes).max() * np.abs(arms).max())
    assert not np.any(probe(model, index, 0, world, time))
