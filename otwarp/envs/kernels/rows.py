"""Rows of a table, copied into those of worlds, and rows of numbers that are written at once."""

import functools
from typing import Any

import warp as wp

from otwarp.kernels.core.functions import function_from_text


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


@functools.lru_cache(maxsize=1024)
def row_type(width: int) -> Any:
    """Type of a row of so many numbers; of one where there are none."""
    return wp.types.vector(length=max(width, 1), dtype=wp.float32)


def _pieces(width: int, single: int) -> str:
    """Stores of a row of which so many numbers come before an address that 16 divides: as few as there can be."""
    text, n = "", 0
    while n < width:
        size = next(s for s in (4, 2, 1) if (n - single) % s == 0 and n + s <= width)
        if size == 1:
            text += f" to[{n}] = row[{n}];"
        else:
            numbers = ", ".join(f"row[{n + i}]" for i in range(size))
            text += f" *(float{size}*)(to + {n}) = make_float{size}({numbers});"
        n += size
    return text


@functools.lru_cache(maxsize=1024)
def store_row_term(width: int) -> wp.Function:
    """`(rows, world, row)`: write a row of so many numbers, of a type of `row_type`, into an array (W, width).

    On a GPU with stores of up to four numbers: each store of a warp goes to as many sectors of memory as it has
    threads, whether it writes 4 of their 32 bytes or 16. Rows of an even width begin where 8 divides the address.
    """
    offsets = range(0, 4, 4 if width % 4 == 0 else 2 if width % 2 == 0 else 1)
    cases = "\n".join(f"        case {(4 - s) % 4}:{_pieces(width, s)} return;" for s in offsets)
    snippet = f"""
    float* to = (float*)rows.data + (size_t)world * {width};
#if defined(__CUDA_ARCH__)
    switch (((size_t)to >> 2) & 3) {{
{cases}
    }}
#endif
    for (int n = 0; n < {width}; ++n)
        to[n] = row[n];
"""
    text = (
        "def store_row(rows: Rows, world: int, row: Row):\n"
        '    """Write a row of numbers; rows follow each other without gaps."""\n    ...\n'
    )
    names = {"Rows": wp.array2d(dtype=wp.float32), "Row": row_type(width)}
    return wp.func_native(snippet)(function_from_text("store_row", text, names))
