"""Threads of a world wait for each other, and answer together, whatever the other worlds of their block do."""

import numpy as np
import warp as wp

from otwarp.kernels.drivers.grid.teams import Lane, any_of, meet, seat_of

LANES = 64


@wp.kernel(enable_backward=False, grid_stride=False)
def count_down(lanes: int, left: wp.array2d(dtype=wp.int32), turns: wp.array(dtype=wp.int32)):
    """Each thread takes one from its neighbour's number after the other, until its world has none left."""
    row, lane = wp.tid()
    me = Lane(row, lane, lanes, seat_of(lanes))
    going = wp.int32(1)
    while going != 0:
        mine = left[row, (lane + 1) % lanes]
        meet(me)
        left[row, (lane + 1) % lanes] = wp.max(mine - 1, 0)
        going = any_of(me, wp.where(mine > 1, 1, 0))
        if lane == 0:
            turns[row] = turns[row] + 1


def test_worlds_of_a_block_take_as_many_turns_as_each_needs(device):
    """World w begins with w + 1 in one of its numbers, which only one of its threads sees."""
    lanes = 1 if wp.get_device(device).is_cpu else LANES
    worlds = 7
    start = np.zeros((worlds, lanes), dtype=np.int32)
    start[:, -1] = np.arange(worlds) + 1
    left = wp.array(start, dtype=wp.int32, device=device)
    turns = wp.zeros(worlds, dtype=wp.int32, device=device)
    block = 1 if lanes == 1 else 4 * lanes
    wp.launch(count_down, dim=(worlds, lanes), inputs=[lanes, left, turns], device=device, block_dim=block)
    np.testing.assert_array_equal(turns.numpy(), np.arange(worlds) + 1)
    assert not np.any(left.numpy())
