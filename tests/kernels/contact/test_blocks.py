"""Factors of matrices of 3×3 blocks against NumPy."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.blocks import block_at, block_count, factorise, solve_factorised
from otwarp.simulation.packing.arrays import device_array

NODES = 5
BLOCKS = block_count(NODES)

ROUNDING = 2e-5
"""Solutions relative to the largest, in float32, of matrices whose condition is some tens."""

ARROW = [(4, 0), (4, 1), (4, 2), (4, 3), (1, 0), (3, 2)]
"""Two rigid bodies that touch a sphere which comes last."""

FILLED_IN = [(1, 0), (3, 0), (4, 0), (4, 2)]
"""Blocks that arise while the first row is eliminated: (3, 1), (4, 1), (4, 3)."""


@wp.kernel(enable_backward=False)
def solve_blocks(filled: wp.array(dtype=int), block: wp.array(dtype=wp.mat33), side: wp.array(dtype=wp.vec3)):
    factorise(NODES, filled, block)
    solve_factorised(NODES, filled, block, side)


@wp.kernel(enable_backward=False)
def places(at: wp.array2d(dtype=int)):
    i, j = wp.tid()
    if j <= i:
        at[i, j] = block_at(i, j)


def test_blocks_are_stored_row_by_row(device):
    at = wp.full((NODES, NODES), -1, dtype=int, device=device)
    wp.launch(places, dim=(NODES, NODES), inputs=[at], device=device)
    assert at.numpy()[np.tril_indices(NODES)].tolist() == list(range(BLOCKS))


@pytest.mark.parametrize("pattern", [[], ARROW, FILLED_IN], ids=["diagonal", "arrow", "filled in"])
def test_solutions_are_those_of_the_whole_matrix(pattern, device):
    rng = np.random.default_rng(len(pattern))
    a = np.zeros((3 * NODES, 3 * NODES))
    for i in range(NODES):
        m = rng.normal(size=(3, 3))
        a[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = m @ m.T + 12.0 * np.eye(3)
    for i, j in pattern:
        m = rng.normal(size=(3, 3))
        a[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = m
        a[3 * j : 3 * j + 3, 3 * i : 3 * i + 3] = m.T
    side = rng.normal(size=(NODES, 3))
    # what is not marked as filled is never read
    block = np.full((BLOCKS, 3, 3), np.nan)
    for i, j in [*pattern, *((k, k) for k in range(NODES))]:
        block[i * (i + 1) // 2 + j] = a[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
    filled = [sum(1 << j for k, j in pattern if k == i) for i in range(NODES)]
    inputs = [
        device_array(filled, wp.int32, device),
        device_array(block, wp.mat33, device),
        device_array(side, wp.vec3, device),
    ]
    wp.launch(solve_blocks, dim=1, inputs=inputs, device=device)
    expected = np.linalg.solve(a, side.ravel()).reshape(NODES, 3)
    np.testing.assert_allclose(inputs[2].numpy(), expected, atol=ROUNDING * np.abs(expected).max())
