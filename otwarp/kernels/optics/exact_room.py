"""Room that a thread of an exact force has for its nodes and multipoles.

On a CPU it is local arrays. A GPU reserves those for as many threads as it can hold, used or not (36 kB each for 512
nodes, 19 GiB on an H200): there threads take their parts of one array, which is as long as a launch has threads.
"""

import warp as wp

from otwarp.kernels.core.exact_data import ROW

WARP = 32
"""Threads whose parts lie in turns, element by element, as a GPU reads them."""


def room_of(orders: int, nodes: int) -> int:
    """Complex numbers that a thread keeps: a pair of numbers and three waves per node, two rows of A and of B."""
    return 4 * nodes + 4 * row_of(orders)


def row_of(orders: int) -> int:
    """Length of a row of A or B, whose last multipoles are written eight at a time."""
    return orders + ROW + 1


@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
    const size_t block = ((size_t)blockIdx.z * gridDim.y + blockIdx.y) * gridDim.x + blockIdx.x;
    const size_t thread = block * blockDim.x + threadIdx.x;
    auto part = room;
    part.data += (thread / {WARP} * whole + first) * {WARP} + thread % {WARP};
    part.shape.dims[0] = count;
    part.strides[0] = {WARP} * sizeof(*room.data);
    return part;
#else
    return room;
#endif
""")
def own_part(room: wp.array(dtype=wp.vec2d), whole: int, first: int, count: int) -> wp.array(dtype=wp.vec2d):
    """`count` elements from `first` on of this thread's part of a room, which has `whole`; CUDA alone."""
    ...
