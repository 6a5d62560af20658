"""Counter-based random numbers: Philox4x32-10 and Gaussian deviates made from it.

Salmon, Moraes, Dror, Shaw 2011, "Parallel random numbers: as easy as 1, 2, 3", doi:10.1145/2063384.2063405.

The counter is (step low, step high, world, body) and the key (seed, stream), so a deviate depends on what it is for
and on nothing else: not on batch size, launch grouping, threads or devices.
"""

import enum

import warp as wp


class Stream(enum.IntEnum):
    """Registry of random streams: one number per purpose, never reused."""

    BROWNIAN_A = 0
    """First four deviates of a body's thermal noise (translation, first rotation)."""
    BROWNIAN_B = 1
    """Last two deviates of a rigid body's thermal noise."""


vec4u = wp.types.vector(length=4, dtype=wp.uint32)

_ROUNDS = 10
_M0 = wp.constant(wp.uint32(0xD2511F53))
_M1 = wp.constant(wp.uint32(0xCD9E8D57))
_W0 = wp.constant(wp.uint32(0x9E3779B9))
_W1 = wp.constant(wp.uint32(0xBB67AE85))
_TO_UNIT = wp.constant(2.0**-32)
_TWO_PI = wp.constant(6.283185307179586)


@wp.func
def philox(counter: vec4u, seed: wp.uint32, stream: wp.uint32) -> vec4u:
    """Philox4x32-10: four independent uniform 32-bit words for a counter and a key (seed, stream)."""
    c0, c1, c2, c3 = counter[0], counter[1], counter[2], counter[3]
    k0, k1 = seed, stream
    for _ in range(wp.static(_ROUNDS)):
        p0 = wp.uint64(_M0) * wp.uint64(c0)
        p1 = wp.uint64(_M1) * wp.uint64(c2)
        n0 = wp.uint32(p1 >> wp.uint64(32)) ^ c1 ^ k0
        n2 = wp.uint32(p0 >> wp.uint64(32)) ^ c3 ^ k1
        c1 = wp.uint32(p1)
        c3 = wp.uint32(p0)
        c0 = n0
        c2 = n2
        k0 = k0 + _W0
        k1 = k1 + _W1
    return vec4u(c0, c1, c2, c3)


@wp.func
def gaussian_pair(a: wp.uint32, b: wp.uint32) -> wp.vec2:
    """Two standard normal deviates from two words (Box and Muller 1958, doi:10.1214/aoms/1177706645).

    u = (word + ½)·2⁻³² lies in (0, 1], so the logarithm is finite; the largest deviate is √(2 ln 2³³) ≈ 6.8.
    """
    radius = wp.sqrt(-2.0 * wp.log((wp.float32(a) + 0.5) * _TO_UNIT))
    angle = _TWO_PI * ((wp.float32(b) + 0.5) * _TO_UNIT)
    return wp.vec2(radius * wp.cos(angle), radius * wp.sin(angle))


@wp.func
def noise_words(seed: wp.uint32, stream: wp.uint32, step: wp.int64, world: int, body: int) -> vec4u:
    """The four words that belong to (stream, step, world, body)."""
    low = wp.uint32(step & wp.int64(0xFFFFFFFF))
    high = wp.uint32(step >> wp.int64(32))
    return philox(vec4u(low, high, wp.uint32(world), wp.uint32(body)), seed, stream)
