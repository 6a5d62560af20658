"""Where sums of forces start."""

import numpy as np
import warp as wp

from otwarp.kernels.core.types import mat66
from otwarp.kernels.forces.zeros import ZEROS, no_body_stiffness, no_force, no_stiffness, no_wrench


@wp.kernel(enable_backward=False)
def zeros(
    force: wp.array(dtype=wp.vec3), torque: wp.array(dtype=wp.vec3), stiffness: wp.array(dtype=wp.mat33),
    body: wp.array(dtype=mat66),
):  # fmt: skip
    force[0] = no_force() + no_wrench().force
    torque[0] = no_wrench().torque
    stiffness[0] = no_stiffness()
    body[0] = no_body_stiffness()


def test_nothing_is_zero(device):
    kinds = (wp.vec3, wp.vec3, wp.mat33, mat66)
    outputs = [wp.full(1, kind(7.0), dtype=kind, device=device) for kind in kinds]
    wp.launch(zeros, dim=1, inputs=outputs, device=device)
    for out in outputs:
        assert not np.any(out.numpy())
    assert [kind for kind, _ in ZEROS.values()] == [wp.vec3, wp.mat33]
