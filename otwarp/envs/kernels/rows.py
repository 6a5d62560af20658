"""Rows of a table, copied into those of chosen worlds."""

import warp as wp


@wp.kernel(enable_backward=False)
def copy_rows(
    flags: wp.array(dtype=wp.int32), row: wp.array(dtype=wp.int32), source: wp.array2d(dtype=wp.float32),
    target: wp.array2d(dtype=wp.float32),
):  # fmt: skip
    """For each flagged world, its row of the source."""
    world = wp.tid()
    if flags[world] != 0:
        for n in range(target.shape[1]):
            target[world, n] = source[row[world], n]
