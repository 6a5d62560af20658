"""The cell of a grid that a coordinate is in."""

import warp as wp

ROUNDER = 12582912.0
"""1.5·2²³: adding it to a number below 2²² leaves the nearest integer in the low bits."""

_FLOOR = """
#if defined(__CUDA_ARCH__)
    return {cuda};
#else
    return {cpu};
#endif
"""


@wp.func_native(_FLOOR.format(cuda=f"__float_as_int(u - 0.5f + {ROUNDER}f) - 0x4B400000", cpu="(int)u"))
def cell_of(u: wp.float32) -> wp.int32:
    """Cell of a grid coordinate 0 ≤ u < 2²²; at a node either neighbour. Conversions are slow on CUDA, sums are not."""
    ...


@wp.func_native(_FLOOR.format(cuda=f"(u - 0.5f + {ROUNDER}f) - {ROUNDER}f", cpu="(float)(int)u"))
def cell_start(u: wp.float32) -> wp.float32:
    """Coordinate at which the cell of u starts, in cells."""
    ...
