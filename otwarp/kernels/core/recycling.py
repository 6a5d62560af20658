"""Cells that leave through an outlet and come in again at an inlet: who has left, and where one may come in.

Places come from counters, as all random numbers do: the n-th try of a cell in a step is the same on any device, in any
driver and whatever else happens in the world.
"""

import warp as wp

from otwarp.kernels.core.random import Stream, noise_words, uniform
from otwarp.kernels.core.types import ModelData

TRIES = wp.constant(16)
"""Places at which a cell tries to come in within a step; then it waits for the next."""


@wp.func
def has_left(model: ModelData, b: int, position: wp.vec3) -> bool:
    """Whether body b is one that comes in again, and its `position` [µm] beyond an end of the domain."""
    inlet = model.inlets[0]
    low = position - inlet.domain_low
    high = inlet.domain_high - position
    inside = wp.min(wp.min(low[0], wp.min(low[1], low[2])), wp.min(high[0], wp.min(high[1], high[2]))) >= 0.0
    return inlet.recycled[b] != 0 and not inside


@wp.func
def entry_place(model: ModelData, number: int, b: int, step: wp.int64, attempt: int) -> wp.vec3:
    """A place in the inlet [µm], uniformly distributed, for one attempt of body b in the step that arrives at `step`.

    Args:
        number: Of the trial of the body's world, as noise goes by.
    """
    words = noise_words(
        model.seed, wp.static(wp.uint32(Stream.ENTRY)), step * wp.int64(TRIES) + wp.int64(attempt), number, b
    )
    inlet = model.inlets[0]
    return inlet.low + wp.cw_mul(wp.vec3(uniform(words[0]), uniform(words[1]), uniform(words[2])), inlet.size)
