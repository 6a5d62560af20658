"""Parameters given once serve every world."""

import numpy as np
import warp as wp

from otwarp.kernels.core.types import world_row


@wp.kernel(enable_backward=False)
def rows(given: int, out: wp.array(dtype=int)):
    out[wp.tid()] = world_row(given, wp.tid())


def test_a_parameter_has_one_row_or_one_per_world(device):
    out = wp.zeros(4, dtype=int, device=device)
    for given, expected in ((1, [0, 0, 0, 0]), (4, [0, 1, 2, 3])):
        wp.launch(rows, dim=4, inputs=[given, out], device=device)
        np.testing.assert_array_equal(out.numpy(), expected)
