"""Four numbers in one vector: a point, and the one that belongs to it."""

import numpy as np
import warp as wp

from otwarp.kernels.core.packed import beside, distance_of, point_of, power_of, radius_of


@wp.kernel(enable_backward=False)
def unpack(
    packed: wp.vec4, point: wp.array(dtype=wp.vec3), number: wp.array(dtype=float), again: wp.array(dtype=wp.vec4)
):
    point[0] = point_of(packed)
    number[0] = power_of(packed)
    number[1] = radius_of(packed)
    number[2] = distance_of(packed)
    again[0] = beside(point_of(packed), power_of(packed))


def test_a_point_and_its_number_come_out_as_they_went_in(device):
    point, again = (wp.zeros(1, dtype=kind, device=device) for kind in (wp.vec3, wp.vec4))
    number = wp.zeros(3, dtype=float, device=device)
    wp.launch(unpack, dim=1, inputs=[wp.vec4(1.0, 2.0, 3.0, 4.0), point, number, again], device=device)
    np.testing.assert_array_equal(point.numpy(), [[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(number.numpy(), [4.0, 4.0, 4.0])
    np.testing.assert_array_equal(again.numpy(), [[1.0, 2.0, 3.0, 4.0]])
