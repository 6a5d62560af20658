"""Space that repeats: the nearest image of a point, and bodies put back into the cell they have left.

Along a periodic axis all that a body meets is the nearest of its images (minimum image convention; Allen, Tildesley,
Computer Simulation of Liquids, 2nd ed. 2017, section 1.6.2, doi:10.1093/oso/9780198803195.001.0001). Positions stay in
the cell, so that float32 serves a run of any length; how often a body has crossed is counted.
"""

import warp as wp

from otwarp.kernels.core.types import ModelData, PeriodData, StateData


@wp.func
def image_shift(period: PeriodData, away: wp.vec3) -> wp.vec3:
    """What to add to the difference `away` of two points [µm] for that of the nearest images; exactly 0 within them."""
    turns = wp.cw_mul(away, period.per_length)
    return -wp.cw_mul(wp.vec3(wp.rint(turns[0]), wp.rint(turns[1]), wp.rint(turns[2])), period.length)


@wp.func
def nearest(period: PeriodData, away: wp.vec3) -> wp.vec3:
    """Shortest of all differences between the images of two points, one of which is `away` [µm]."""
    return away + image_shift(period, away)


@wp.func
def kept_in_cell(model: ModelData, state: StateData, world: int, b: int, position: wp.vec3) -> wp.vec3:
    """The image of a body's `position` [µm] in the cell; counts in `state.image` by how many cells it has gone on."""
    turns = wp.cw_mul(position - model.period.low, model.period.per_length)
    gone = wp.vec3(wp.floor(turns[0]), wp.floor(turns[1]), wp.floor(turns[2]))
    inside = position
    if wp.length_sq(gone) > 0.0:
        state.image[world, b] = state.image[world, b] + wp.vec3i(int(gone[0]), int(gone[1]), int(gone[2]))
        inside = position - wp.cw_mul(gone, model.period.length)
    return inside
