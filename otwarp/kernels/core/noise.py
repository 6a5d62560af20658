"""Deviates of thermal noise: Gaussian, or a cheaper distribution with the same low moments.

A time step of weak order 1 or 2 needs from its noise only E ξ = E ξ³ = E ξ⁵ = 0 and E ξ² = 1, and for order 2 also
E ξ⁴ = 3 (Kloeden & Platen 1992, doi:10.1007/978-3-662-12616-5, chapter 14; Dünweg & Paul 1991,
doi:10.1142/S0129183191001037). Three-point deviates serve both orders, uniform ones order 1. Averages over many paths
then converge as fast in the time step as with Gaussian noise; the distribution of a single step is another one.

Three-point and uniform deviates come from 16 bits each, the low half of a word before its high half. Their levels are
symmetric about 0 and scaled to a variance of 1, so that odd moments and temperature are exact.
"""

import functools
import math

import warp as wp

from otwarp.kernels.core.random import GAUSSIAN_TERMS, Stream, noise_words
from otwarp.kernels.core.types import vec6

NOISES = ("gaussian", "threePoint", "uniform")
"""Distributions by name."""

OUTER = 10923
"""Of 2¹⁶ values those that give +√3, and as many −√3: the integer next to 2¹⁶/6."""

POINT = math.sqrt(2**16 / (2 * OUTER))
"""√3 but for a relative 1.5e-5, so that the variance is 1. The fourth moment is 2.99991 in place of 3."""

STEP = math.sqrt(12.0 / (2**32 - 1))
"""Spacing of 2¹⁶ uniform levels of variance 1. The largest deviate is √3, the fourth moment 9/5."""

_POINT = wp.constant(POINT)
_STEP = wp.constant(STEP)
UPPER = wp.constant(wp.int32((32768 - OUTER) << 16))
LOWER = wp.constant(wp.int32(-((32768 - OUTER) << 16)))
"""From where a half gives +√3, and below where −√3: it counts as the signed high half of a word, and what the low half
holds cannot move it across."""


@wp.func
def three_point(half: wp.int32) -> wp.float32:
    """+√3 and −√3 with probability 1/6 each (10923/65536), else 0, from the high 16 bits."""
    return wp.where(half >= UPPER, _POINT, wp.where(half < LOWER, -_POINT, 0.0))


@wp.func
def uniform_deviate(half: wp.int32) -> wp.float32:
    """One of 65536 equally likely values in (−√3, √3), of mean 0 and variance 1, from the high 16 bits."""
    return (wp.float32(half >> 16) + 0.5) * _STEP


WEAK_TERMS = {"threePoint": three_point, "uniform": uniform_deviate}
"""A deviate from the high half of a word."""


@wp.func
def low_half(word: wp.uint32) -> wp.int32:
    """The low 16 bits of a word, moved to its high half, as the terms of `WEAK_TERMS` take them."""
    return wp.int32(word << wp.uint32(16))


@wp.func
def high_half(word: wp.uint32) -> wp.int32:
    """The word as it is: the terms of `WEAK_TERMS` read its high 16 bits alone."""
    return wp.int32(word)


@functools.lru_cache(maxsize=8)
def three_deviates_term(noise: str, fast_math: bool = False) -> wp.Function:
    """`(seed, step, world, body) -> vec3`: what a lone sphere needs for one step.

    Args:
        noise: One of `NOISES`.
        fast_math: As `GAUSSIAN_TERMS`.
    """
    if noise == "gaussian":
        pair = GAUSSIAN_TERMS[fast_math]

        @wp.func
        def three_gaussian(seed: wp.uint32, step: wp.int64, world: int, body: int) -> wp.vec3:
            """Three standard normal deviates from one call of Philox."""
            words = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
            xy = pair(words[0], words[1])
            z = pair(words[2], words[3])
            return wp.vec3(xy[0], xy[1], z[0])

        return three_gaussian
    deviate = WEAK_TERMS[noise]

    @wp.func
    def three_weak(seed: wp.uint32, step: wp.int64, world: int, body: int) -> wp.vec3:
        """Three deviates of mean 0 and variance 1, each from 16 bits of two words."""
        words = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
        return wp.vec3(deviate(low_half(words[0])), deviate(high_half(words[0])), deviate(low_half(words[1])))

    return three_weak


@functools.lru_cache(maxsize=8)
def six_deviates_term(noise: str, fast_math: bool = False) -> wp.Function:
    """`(seed, step, world, body) -> vec6`: what a rigid body needs for one step; arguments as `three_deviates_term`."""
    if noise == "gaussian":
        pair = GAUSSIAN_TERMS[fast_math]

        @wp.func
        def six_gaussian(seed: wp.uint32, step: wp.int64, world: int, body: int) -> vec6:
            """Six standard normal deviates from two calls of Philox, one for each stream."""
            a = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
            c = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_B)), step, world, body)
            g0 = pair(a[0], a[1])
            g1 = pair(a[2], a[3])
            g2 = pair(c[0], c[1])
            return vec6(g0[0], g0[1], g1[0], g1[1], g2[0], g2[1])

        return six_gaussian
    deviate = WEAK_TERMS[noise]

    @wp.func
    def six_weak(seed: wp.uint32, step: wp.int64, world: int, body: int) -> vec6:
        """Six deviates of mean 0 and variance 1, each from 16 bits of three words: one call of Philox, not two."""
        words = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
        return vec6(
            deviate(low_half(words[0])),
            deviate(high_half(words[0])),
            deviate(low_half(words[1])),
            deviate(high_half(words[1])),
            deviate(low_half(words[2])),
            deviate(high_half(words[2])),
        )

    return six_weak
