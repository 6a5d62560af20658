"""Random numbers for float64 kernels: those of `otwarp.kernels.core.random`, bit for bit, cast.

A path in float64 has the same noise as in float32, so that the two differ by rounding alone.
"""

import warp as wp

from otwarp.kernels.core.random import GAUSSIAN_TERMS as SINGLE_TERMS
from otwarp.kernels.core.random import Stream, noise_words
from otwarp.kernels.core.random import squared_radius as single_squared_radius
from otwarp.kernels.core.random import uniform as single_uniform

__all__ = ["GAUSSIAN_TERMS", "Stream", "noise_words", "squared_radius", "uniform"]


@wp.func
def uniform(word: wp.uint32) -> wp.float64:
    """u = (word + ½)·2⁻³² in (0, 1] as float32 rounds it, as float64."""
    return wp.float64(single_uniform(word))


@wp.func
def squared_radius(word: wp.uint32) -> wp.float64:
    """−2 ln u of the u that `uniform` gives, but for its error of 3e-7."""
    return wp.float64(single_squared_radius(word))


def _cast(pair: wp.Function) -> wp.Function:
    @wp.func
    def pair_in_double(a: wp.uint32, b: wp.uint32) -> wp.vec2d:
        """The two standard normal float32 deviates of two words, as float64."""
        xy = pair(a, b)
        return wp.vec2d(wp.float64(xy[0]), wp.float64(xy[1]))

    return pair_in_double


GAUSSIAN_TERMS = {fast: _cast(pair) for fast, pair in SINGLE_TERMS.items()}
"""Two deviates from two words, by whether `fast_math` is on."""
