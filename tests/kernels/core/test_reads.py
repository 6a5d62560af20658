"""Reads without strides, against NumPy."""

import numpy as np
import warp as wp

from otwarp.kernels.core.reads import index_at, number_at, vec4_at


@wp.kernel(enable_backward=False)
def read_all(
    rows: wp.array(dtype=wp.vec4), indices: wp.array(dtype=wp.int32), table: wp.array2d(dtype=wp.float32),
    row: wp.array(dtype=wp.vec4), index: wp.array(dtype=wp.int32), number: wp.array2d(dtype=wp.float32),
):  # fmt: skip
    """Copy three arrays by the functions under test."""
    i = wp.tid()
    row[i] = vec4_at(rows, i)
    index[i] = index_at(indices, i)
    for j in range(table.shape[1]):
        number[i, j] = number_at(table, i, j)


def test_reads_are_those_of_numpy(device):
    rng = np.random.default_rng(1)
    n = 37
    rows, indices = rng.normal(size=(n, 4)).astype(np.float32), rng.integers(0, 99, n).astype(np.int32)
    table = rng.normal(size=(n, 5)).astype(np.float32)
    given = [wp.array(rows, dtype=wp.vec4, device=device), wp.array(indices, device=device)]
    given.append(wp.array(table, device=device))
    out = [wp.zeros_like(array) for array in given]
    wp.launch(read_all, dim=n, inputs=given, outputs=out, device=device)
    for array, expected in zip(out, (rows, indices, table), strict=True):
        np.testing.assert_array_equal(array.numpy(), expected)
