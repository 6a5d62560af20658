"""Deviates of thermal noise for float64 kernels: those of `otwarp.kernels.core.noise`, cast."""

import functools

import warp as wp

from otwarp.kernels.core.noise import NOISES, high_half, low_half
from otwarp.kernels.core.noise import WEAK_TERMS as SINGLE_TERMS
from otwarp.kernels.core.noise import six_deviates_term as six_single
from otwarp.kernels.core.noise import three_deviates_term as three_single
from otwarp.kernels.core.precision import kernel_module

__all__ = ["NOISES", "WEAK_TERMS", "high_half", "low_half", "six_deviates_term", "three_deviates_term"]

vec6 = kernel_module("core.types", "float64").vec6


def _cast(deviate: wp.Function) -> wp.Function:
    @wp.func
    def deviate_in_double(half: wp.int32) -> wp.float64:
        """The float32 deviate of the high half of a word, as float64."""
        return wp.float64(deviate(half))

    return deviate_in_double


WEAK_TERMS = {name: _cast(deviate) for name, deviate in SINGLE_TERMS.items()}
"""A deviate from the high half of a word."""


@functools.lru_cache(maxsize=8)
def three_deviates_term(noise: str, fast_math: bool = False) -> wp.Function:
    """`(seed, step, world, body) -> vec3d`: what a lone sphere needs for one step."""
    single = three_single(noise, fast_math)

    @wp.func
    def three_in_double(seed: wp.uint32, step: wp.int64, world: int, body: int) -> wp.vec3d:
        """The three float32 deviates of the step, bit for bit, as float64."""
        xi = single(seed, step, world, body)
        return wp.vec3d(wp.float64(xi[0]), wp.float64(xi[1]), wp.float64(xi[2]))

    return three_in_double


@functools.lru_cache(maxsize=8)
def six_deviates_term(noise: str, fast_math: bool = False) -> wp.Function:
    """`(seed, step, world, body) -> vec6` of float64: what a rigid body needs for one step."""
    single = six_single(noise, fast_math)

    @wp.func
    def six_in_double(seed: wp.uint32, step: wp.int64, world: int, body: int) -> vec6:
        """The six float32 deviates of the step, bit for bit, as float64."""
        xi = single(seed, step, world, body)
        return vec6(
            wp.float64(xi[0]), wp.float64(xi[1]), wp.float64(xi[2]),
            wp.float64(xi[3]), wp.float64(xi[4]), wp.float64(xi[5]),
        )  # fmt: skip

    return six_in_double
