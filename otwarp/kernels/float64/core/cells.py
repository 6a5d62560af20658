"""The cell of a grid that a float64 coordinate is in: as `otwarp.kernels.core.cells`."""

import warp as wp


@wp.func
def cell_of(u: wp.float64) -> wp.int32:
    """Cell of a grid coordinate 0 ≤ u < 2³¹."""
    return wp.int32(u)


@wp.func
def cell_start(u: wp.float64) -> wp.float64:
    """Coordinate at which the cell of u starts, in cells."""
    return wp.float64(wp.int32(u))
