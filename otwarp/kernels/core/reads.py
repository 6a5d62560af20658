"""Reads of contiguous arrays, without the strides and negative indices of Warp: a dozen instructions fewer each.

Neighbouring elements share an address, and CUDA reads four numbers at once; also those of a row of another array, and
writes them.
"""

import warp as wp

from otwarp.kernels.core.types import mat66


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return *reinterpret_cast<const decltype(rows.data)>(__builtin_assume_aligned(rows.data + n, 16));
#else
    return rows.data[n];
#endif
""")
def vec4_at(rows: wp.array(dtype=wp.vec4), n: int) -> wp.vec4:
    """Row n of an array of its own, which Warp begins at a multiple of 16 bytes; in the array's units."""
    ...


@wp.func_native("""
    return static_cast<int>(column.strides[0] / sizeof(*column.data));
""")
def pitch_of(column: wp.array(dtype=wp.vec4)) -> int:
    """How many elements apart [1] neighbours are in a view of one column of an array.

    Columns of arrays of one shape have it in common: an index times it serves to read and write all of them.
    """
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    *reinterpret_cast<decltype(rows.data)>(__builtin_assume_aligned(rows.data + n, 16)) = value;
#else
    rows.data[n] = value;
#endif
""")
def put_vec4(rows: wp.array(dtype=wp.vec4), n: int, value: wp.vec4):
    """Write row n, as `vec4_at` reads it."""
    ...


@wp.func_native("""
    return values.data[n];
""")
def vec2_at(values: wp.array(dtype=wp.vec2), n: int) -> wp.vec2:
    """Entry n, in the array's units."""
    ...


@wp.func_native("""
    values.data[n] = value;
""")
def put_vec2(values: wp.array(dtype=wp.vec2), n: int, value: wp.vec2):
    """Write entry n, in the array's units."""
    ...


@wp.func_native("""
    return values.data[n];
""")
def pair_at(values: wp.array(dtype=wp.vec2i), n: int) -> wp.vec2i:
    """The two indices [1] of entry n."""
    ...


@wp.func_native("""
    values.data[n] = value;
""")
def put_pair(values: wp.array(dtype=wp.vec2i), n: int, value: wp.vec2i):
    """Write the two indices [1] of entry n."""
    ...


@wp.func_native("""
    return values.data[n];
""")
def real_at(values: wp.array(dtype=wp.float32), n: int) -> float:
    """Entry n, in the array's units."""
    ...


@wp.func_native("""
    values.data[n] = value;
""")
def put_real(values: wp.array(dtype=wp.float32), n: int, value: float):
    """Write entry n, in the array's units."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return *reinterpret_cast<const decltype(rows.data)>(__builtin_assume_aligned(rows.data + n, 16));
#else
    return rows.data[n];
#endif
""")
def mat66_at(rows: wp.array(dtype=mat66), n: int) -> mat66:
    """Matrix n of an array of its own, in the array's units."""
    ...


_ROW_OF_TWO = """
    auto entry = rows.data + ((unsigned)row * (unsigned)rows.shape[1] + (unsigned)column);
#if defined(__CUDA_ARCH__)
    entry = reinterpret_cast<decltype(entry)>(__builtin_assume_aligned(entry, 16));
#endif
    return *entry;
"""


@wp.func_native(_ROW_OF_TWO)
def vec4_of(rows: wp.array2d(dtype=wp.vec4), row: int, column: int) -> wp.vec4:
    """The four numbers at (row, column) of an array of its own, in the array's units."""
    ...


@wp.func_native(_ROW_OF_TWO)
def vec4i_of(rows: wp.array2d(dtype=wp.vec4i), row: int, column: int) -> wp.vec4i:
    """The four indices [1] at (row, column) of an array of its own."""
    ...


@wp.func_native("""
    return values.data[n];
""")
def index_at(values: wp.array(dtype=wp.int32), n: int) -> int:
    """Entry n of an array of indices [1]."""
    ...


@wp.func_native("""
    return values.data[row * values.shape[1] + column];
""")
def number_at(values: wp.array2d(dtype=wp.float32), row: int, column: int) -> float:
    """The number at (row, column), in the array's units."""
    ...
