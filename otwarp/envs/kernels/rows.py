"""Rows of a table, copied into those of worlds."""

import warp as wp


@wp.struct
class RowData:
    """One parameter: in a table of variants, and in the worlds; each (rows, numbers)."""

    source: wp.array2d(dtype=wp.float32)
    target: wp.array2d(dtype=wp.float32)


@wp.func
def copy_rows(rows: wp.array(dtype=RowData), row: int, world: int):
    """Copy a row of the table into that of a world, of all parameters."""
    for p in range(rows.shape[0]):
        for n in range(rows[p].target.shape[1]):
            rows[p].target[world, n] = rows[p].source[row, n]
