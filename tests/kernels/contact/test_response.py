"""How far bodies give way: gives beside responses."""

import numpy as np
import warp as wp

from otwarp.hydrodynamics import body_mobility
from otwarp.kernels.contact.contact import along
from otwarp.kernels.contact.response import give_term, response_term
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, Pose, mat66
from otwarp.simulation.packing.arrays import device_array
from tests.kernels.samples import quaternions

FEATURES = Features(driver="world", bodies=2, rigid=True, pairs=True, body_space=True)
_response, _give = (term(FEATURES) for term in (response_term, give_term))

ROUNDING = 1e-5


@wp.kernel(enable_backward=False)
def probe_response(
    model: ModelData, position: wp.array(dtype=wp.vec3), rotation: wp.array(dtype=wp.quat), arm: wp.vec3,
    normal: wp.vec3, found: wp.array(dtype=float),
):  # fmt: skip
    for b in range(2):
        pose = Pose(position[b], rotation[b])
        found[2 * b] = _give(model, b, pose, 0.05, arm, normal)
        found[2 * b + 1] = along(_response(model, b, pose, 0.05, arm, normal), arm, normal)


def test_gives_are_responses_along_the_normal(device):
    """nᵀ J M Jᵀ n dt/η of a rigid body and of a lone sphere, against float64."""
    move = body_mobility(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2.5, 0]]), np.array([1.0, 1.0, 1.2]))
    rng = np.random.default_rng(4)
    model = ModelData()
    model.time_step = 1e-3
    model.medium.viscosity = device_array([0.02], wp.float32, device)
    model.body.shape = device_array([0, 0], wp.int32, device)
    model.body.rigid = device_array([0, 1], wp.int32, device)
    model.body.translation = device_array([0.04], wp.float32, device)
    model.body.mobility = device_array([move.mobility], mat66, device)
    normal, arm, found = np.array([0.6, 0.0, 0.8]), np.array([0.5, -1.0, 2.0]), wp.zeros(4, dtype=float, device=device)
    rotation = quaternions(rng, 2)
    poses = [device_array(np.zeros((2, 3)), wp.vec3, device), device_array(rotation, wp.quat, device)]
    wp.launch(probe_response, dim=1, inputs=[model, *poses, wp.vec3(*arm), wp.vec3(*normal), found], device=device)
    x, y, z, w = rotation[1].astype(float)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    wrench = np.concatenate([turn.T @ normal, turn.T @ np.cross(arm, normal)])
    rigid = 0.05 * wrench @ move.mobility @ wrench
    np.testing.assert_allclose(found.numpy(), [0.002, 0.002, rigid, rigid], rtol=ROUNDING)
