"""Elements of contiguous arrays are read and written where Warp's own indexing has them."""

import numpy as np
import warp as wp

from otwarp.kernels.core.contiguous import reader, writer

four_in_row, put_four = reader(wp.vec4f, 2), writer(wp.vec4f, 2)
count_at, put_count = reader(wp.int32), writer(wp.int32)
point_in_row, put_point = reader(wp.vec3f, 2), writer(wp.vec3f, 2)


@wp.kernel(enable_backward=False)
def turn_over(
    four: wp.array2d(dtype=wp.vec4), point: wp.array2d(dtype=wp.vec3), count: wp.array(dtype=wp.int32),
    fours: wp.array2d(dtype=wp.vec4), points: wp.array2d(dtype=wp.vec3), counts: wp.array(dtype=wp.int32),
):  # fmt: skip
    """Copy everything with rows exchanged, and the counts backwards."""
    j = wp.tid()
    for i in range(2):
        put_four(fours, 1 - i, j, four_in_row(four, i, j))
        put_point(points, 1 - i, j, point_in_row(point, i, j))
    put_count(counts, 2 - j, count_at(count, j))


def test_elements_are_where_they_should_be(device):
    given = [np.arange(2 * 3 * n, dtype=np.float32).reshape(2, 3, n) for n in (4, 3)]
    counts = np.arange(3, dtype=np.int32)
    arrays = [wp.array(a, dtype=t, device=device) for a, t in zip(given, (wp.vec4, wp.vec3), strict=True)]
    arrays.append(wp.array(counts, dtype=wp.int32, device=device))
    found = [wp.zeros_like(a) for a in arrays]
    wp.launch(turn_over, dim=3, inputs=[*arrays, *found], device=device)
    for wanted, got in zip((given[0][::-1], given[1][::-1], counts[::-1]), found, strict=True):
        np.testing.assert_array_equal(got.numpy(), wanted)
