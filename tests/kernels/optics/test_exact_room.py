"""Room of exact forces: threads of a GPU keep apart, and scenes have enough of it."""

import numpy as np
import warp as wp

from otwarp.kernels.optics.exact_room import WARP, own_part, room_of, row_of
from otwarp.optics.batched import room_for

WHOLE, FIRST, COUNT = 7, 2, 4
THREADS = 3 * WARP + 5


@wp.kernel(enable_backward=False)
def mark(room: wp.array(dtype=wp.vec2d), one: wp.array(dtype=wp.vec2d)):
    """Write the thread and the element into this thread's part, or into the whole room where it has no part."""
    i = wp.tid()
    part = own_part(room, WHOLE, FIRST, COUNT)
    count = int(COUNT)
    for k in range(count):
        part[k] = wp.vec2d(wp.float64(i), wp.float64(k))
    one[i] = part[1]


def test_parts_of_threads_are_disjoint_and_in_turns(device):
    warps = -(-THREADS // WARP)
    room = wp.full(warps * WARP * WHOLE, wp.vec2d(-1.0, -1.0), dtype=wp.vec2d, device=device)
    one = wp.zeros(THREADS, dtype=wp.vec2d, device=device)
    wp.launch(mark, dim=THREADS, inputs=[room, one], device=device)
    np.testing.assert_array_equal(one.numpy(), np.stack([np.arange(THREADS), np.ones(THREADS)], axis=1))
    found = room.numpy()
    if wp.get_device(device).is_cpu:  # threads take turns in one room
        np.testing.assert_array_equal(found[:COUNT, 1], np.arange(COUNT))
        return
    found = found.reshape(warps, WHOLE, WARP, 2)
    thread = np.arange(warps * WARP).reshape(warps, 1, WARP)
    expected = np.broadcast_to(np.where(thread < THREADS, thread, -1), (warps, COUNT, WARP))
    np.testing.assert_array_equal(found[:, FIRST : FIRST + COUNT, :, 0], expected)
    assert (found[:, [0, 1, 6]] == -1.0).all()


def test_room_holds_all_that_a_thread_keeps(device):
    orders, nodes = 32, 128
    assert room_of(orders, nodes) == 4 * nodes + 2 * 2 * row_of(orders)
    assert row_of(orders) >= orders + 9  # rows are written eight at a time
    room = room_for(33, orders, nodes, wp.get_device(device))
    assert len(room) == (0 if wp.get_device(device).is_cpu else 2 * WARP * room_of(orders, nodes))
