"""Elements of contiguous arrays, without strides.

Warp's own indexing multiplies each index by a stride of 64 bits, and reads a vector component by component: about eight
instructions beside each load, half of a step with contacts on a GPU. These take one or two, and a vector of four at
once.
"""

import functools
from typing import Any

import warp as wp

_PLACE = {1: "i", 2: "static_cast<long long>(i) * data.shape[1] + j"}
_READ = "return data.data[PLACE];"
_WRITE = "data.data[PLACE] = value;"
_READ_FOUR = """
#if defined(__CUDA_ARCH__)
    const float4 v = reinterpret_cast<const float4*>(data.data)[PLACE];
    return wp::vec4(v.x, v.y, v.z, v.w);
#else
    return data.data[PLACE];
#endif
"""
_WRITE_FOUR = """
#if defined(__CUDA_ARCH__)
    reinterpret_cast<float4*>(data.data)[PLACE] = make_float4(value[0], value[1], value[2], value[3]);
#else
    data.data[PLACE] = value;
#endif
"""


@functools.cache
def reader(dtype: Any, ndim: int = 1) -> wp.Function:
    """`(data, i) -> value` or `(data, i, j) -> value` of a contiguous array of a type in one or two dimensions."""
    snippet = (_READ_FOUR if dtype is wp.vec4f else _READ).replace("PLACE", _PLACE[ndim])
    if ndim == 1:

        @wp.func_native(snippet)
        def read(data: wp.array(dtype=dtype), i: int) -> dtype:
            """Element i, 0 to the length − 1, in the units of the array."""
            ...

        return read

    @wp.func_native(snippet)
    def read_in_row(data: wp.array2d(dtype=dtype), i: int, j: int) -> dtype:
        """Element j of row i, both from 0, in the units of the array."""
        ...

    return read_in_row


@functools.cache
def writer(dtype: Any, ndim: int = 1) -> wp.Function:
    """`(data, i, value)` or `(data, i, j, value)` to a contiguous array of a type in one or two dimensions."""
    snippet = (_WRITE_FOUR if dtype is wp.vec4f else _WRITE).replace("PLACE", _PLACE[ndim])
    if ndim == 1:

        @wp.func_native(snippet)
        def write(data: wp.array(dtype=dtype), i: int, value: dtype):
            """Set element i, 0 to the length − 1, in the units of the array."""
            ...

        return write

    @wp.func_native(snippet)
    def write_in_row(data: wp.array2d(dtype=dtype), i: int, j: int, value: dtype):
        """Set element j of row i, both from 0, in the units of the array."""
        ...

    return write_in_row
