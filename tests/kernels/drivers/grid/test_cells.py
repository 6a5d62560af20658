"""Numbers of cells against integers on the host."""

from __future__ import annotations

import numpy as np
import warp as wp

from otwarp.kernels.drivers.grid.cells import cell_key, cell_of
from otwarp.kernels.drivers.grid.data import NeighbourData

CELLS = (4, 8, 16)
EDGE = (1.5, 2.0, 0.75)


@wp.kernel(enable_backward=False)
def keys(n: NeighbourData, world: int, point: wp.array(dtype=wp.vec3), key: wp.array(dtype=wp.int32)):
    """Cell of every point."""
    i = wp.tid()
    c = cell_of(n, point[i])
    key[i] = cell_key(n, world, c[0], c[1], c[2])


def test_cells_repeat_along_each_axis_and_every_world_has_its_own(device):
    """Also left of the origin, and for points so far away that their cells have no int32."""
    near = NeighbourData()
    near.cells, near.edge = wp.vec3i(*CELLS), wp.vec3(*EDGE)
    points = np.random.default_rng(0).uniform(-40.0, 40.0, (500, 3)).astype(np.float32)
    points[-1] = (1e30, -1e30, 0.1)
    key = wp.zeros(500, dtype=wp.int32, device=device)
    place = wp.array(points, dtype=wp.vec3, device=device)
    wp.launch(keys, dim=500, inputs=[near, 3, place], outputs=[key], device=device)
    index = np.floor(points / np.array(EDGE, dtype=np.float32)).clip(-1e9, 1e9).astype(int) % np.array(CELLS)
    expected = np.ravel_multi_index((np.full(500, 3), *index.T), (4, *CELLS))
    np.testing.assert_array_equal(key.numpy(), expected)
    assert len(np.unique(expected)) > 300
