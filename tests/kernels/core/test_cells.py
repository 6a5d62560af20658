"""Cells of a grid in both precisions: those of NumPy's floor."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.core import cells as single
from otwarp.kernels.float64.core import cells as double


@wp.kernel(enable_backward=False)
def cells(
    u: wp.array(dtype=float),
    cell: wp.array2d(dtype=int),
    start: wp.array(dtype=float),
    wide: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    cell[0, i] = single.cell_of(u[i])
    cell[1, i] = double.cell_of(wp.float64(u[i]))
    start[i] = single.cell_start(u[i])
    wide[i] = double.cell_start(wp.float64(u[i]))


@pytest.mark.parametrize("largest", [1.0, 100.0, 2.0**21])
def test_cells_are_those_of_floor(largest, device):
    """At a node either neighbour will do; these coordinates have none."""
    u = np.random.default_rng(0).uniform(0.0, largest, 1000).astype(np.float32)
    u = np.where(u == np.floor(u), u + np.float32(0.25), u)
    cell = wp.zeros((2, 1000), dtype=int, device=device)
    start, wide = (wp.zeros(1000, dtype=t, device=device) for t in (float, wp.float64))
    wp.launch(cells, dim=1000, inputs=[wp.array(u, dtype=float, device=device), cell, start, wide], device=device)
    for got in (*cell.numpy(), start.numpy(), wide.numpy()):
        np.testing.assert_array_equal(got, np.floor(u))
