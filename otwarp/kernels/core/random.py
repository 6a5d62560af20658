"""Counter-based random numbers: Philox4x32-10 and Gaussian deviates made from it.

Salmon, Moraes, Dror, Shaw 2011, "Parallel random numbers: as easy as 1, 2, 3", doi:10.1145/2063384.2063405.

The counter is (step low, step high, world, body) and the key (seed, stream), so a deviate depends on what it is for
and on nothing else: not on batch size, launch grouping, threads or devices.
"""

import enum

import warp as wp

from otwarp.kernels.core.roots import square_root


class Stream(enum.IntEnum):
    """Registry of random streams: one number per purpose, never reused."""

    BROWNIAN_A = 0
    """First four deviates of a body's thermal noise (translation, first rotation)."""
    BROWNIAN_B = 1
    """Last two deviates of a rigid body's thermal noise."""
    CROSSING = 2
    """Whether a path left a trap's reach between two steps; counts traps in place of bodies."""
    CONTACT = 3
    """Least gap within a step; counts elements in place of bodies, the other of a pair above this number's bits."""
    ENTRY = 4
    """Where a body comes in at the inlet; counts tries in place of steps."""
    OPERATOR = 5
    """Motor noise of a simulated operator; counts servo periods, operators and what moves in place of bodies."""
    PERCEPTION = 6
    """Errors of pictures that a simulated operator is given; counts pictures, operators and robots."""
    ENVIRONMENT = 7
    """How an environment's episode starts; counts what is drawn in place of steps and the trials of episodes."""


vec4u = wp.types.vector(length=4, dtype=wp.uint32)

_ROUNDS = 10
_M0 = wp.constant(wp.uint32(0xD2511F53))
_M1 = wp.constant(wp.uint32(0xCD9E8D57))
_W0 = wp.constant(wp.uint32(0x9E3779B9))
_W1 = wp.constant(wp.uint32(0xBB67AE85))
_TO_UNIT = wp.constant(2.0**-32)
_SIGN = wp.constant(wp.uint32(0x80000000))


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    unsigned long long result;
    asm("mul.wide.u32 %0, %1, %2;" : "=l"(result) : "r"(a), "r"(b));
    return result;
#else
    return (wp::uint64)a * (wp::uint64)b;
#endif
""")
def full_product(a: wp.uint32, b: wp.uint32) -> wp.uint64:
    """All 64 bits of a product of words, by one instruction.

    From the plain expression the CUDA compiler keeps the chain of exclusive ors in 64 bits and multiplies there, which
    costs a second multiplication; from the two halves apart it makes two.
    """
    ...


@wp.func
def philox(counter: vec4u, seed: wp.uint32, stream: wp.uint32) -> vec4u:
    """Philox4x32-10: four independent uniform 32-bit words for a counter and a key (seed, stream)."""
    c0, c1, c2, c3 = counter[0], counter[1], counter[2], counter[3]
    k0, k1 = seed, stream
    for _ in range(wp.static(_ROUNDS)):
        p0 = full_product(_M0, c0)
        p1 = full_product(_M1, c2)
        c0 = wp.uint32(p1 >> wp.uint64(32)) ^ c1 ^ k0
        c2 = wp.uint32(p0 >> wp.uint64(32)) ^ c3 ^ k1
        c1 = wp.uint32(p1)
        c3 = wp.uint32(p0)
        k0 = k0 + _W0
        k1 = k1 + _W1
    return vec4u(c0, c1, c2, c3)


@wp.func
def uniform(word: wp.uint32) -> wp.float32:
    """u = (word + ½)·2⁻³², uniform in (0, 1]."""
    return (wp.float32(word) + 0.5) * _TO_UNIT


@wp.func
def squared_radius(word: wp.uint32) -> wp.float32:
    """−2 ln u of u = (word + ½)·2⁻³² ∈ (0, 1], relative error < 3e-7; never negative, finite for every word.

    word + ½ = m·2ᵉ with m = 1 + f in [√½, √2), so that −2 ln u = (e − 32)·(−2 ln 2) − 2f + f² + f³·P(f), P a minimax
    fit of relative error (3e-8). Plain arithmetic, so that compilers can schedule it, where the library's logarithm is
    a call on the CPU.
    """
    bits = wp.cast(wp.float32(word) + 0.5, wp.int32)
    # the exponent less 32; 0x3F3504F3 is √½ and 32 << 23 is 0x10000000
    exponent = (bits - wp.int32(0x4F3504F3)) >> 23
    f = wp.cast(bits - (exponent << 23) - wp.int32(0x10000000), wp.float32) - 1.0
    p = 0.28534987 - 0.1740088 * f
    p = p * f - 0.29829539
    p = p * f + 0.33155168
    p = p * f - 0.39926127
    p = p * f + 0.50002674
    p = p * f - 0.66667821
    f2 = f * f
    return wp.float32(exponent) * -1.3862944 + (f2 + f * f2 * p - 2.0 * f)


@wp.func
def polar(radius: wp.float32, turn: wp.uint32) -> wp.vec2:
    """radius·(cos, sin) of 2π·(turn + ½)·2⁻³², absolute error < 3e-7·radius.

    The half turn nearest to the angle, which is a sign, and the rest t·π with |t| ≤ ½ come from the integer exactly, so
    no argument needs reducing in floating point (on a GPU the library's slow path for that costs registers and local
    memory). sin πt = t·S(t²) and cos πt = 1 + t²·C(t²) with minimax fits S (3e-9) and C (5e-8).
    """
    t = wp.float32(wp.int32(turn << wp.uint32(1))) * 2.3283064365386963e-10 + 1.1641532182693481e-10
    z = t * t
    sine = t * (3.14159258 + z * (-5.16770688 + z * (2.55003138 + z * (-0.59804518 + z * 0.07722014))))
    cosine = 1.0 + z * (-4.93479552 + z * (4.05845134 + z * (-1.33209388 + z * 0.22008069)))
    # between a quarter and three quarters of a turn both change sign
    sign = (turn + wp.uint32(0x40000000)) & _SIGN
    signed = wp.cast(wp.cast(radius, wp.uint32) ^ sign, wp.float32)
    return wp.vec2(signed * cosine, signed * sine)


@wp.func
def gaussian_pair(a: wp.uint32, b: wp.uint32) -> wp.vec2:
    """Two standard normal deviates from two words (Box and Muller 1958, doi:10.1214/aoms/1177706645).

    The largest deviate is √(2 ln 2³³) ≈ 6.8.
    """
    return polar(square_root(squared_radius(a)), b)


@wp.func
def gaussian_pair_fast(a: wp.uint32, b: wp.uint32) -> wp.vec2:
    """The same deviates by the library's functions, which `fast_math` turns into single instructions on CUDA.

    There the absolute error is below 4e-6, and below 1e-3 where u is within 2⁻⁵ of 1 (CUDA C++ Programming Guide,
    intrinsic functions: 2⁻²¹·⁴ for ln near 1, 2⁻²¹·² for sine and cosine); on a CPU the accuracy is that of
    `gaussian_pair`, slower.
    """
    square = -2.0 * wp.log((wp.float32(a) + 0.5) * _TO_UNIT)
    # half a turn to either side: the instructions reduce no arguments. The approximate ln 1 may be above 0
    angle = wp.float32(wp.int32(b)) * 1.4629180792671596e-09
    return square_root(wp.max(square, 0.0)) * wp.vec2(wp.cos(angle), wp.sin(angle))


@wp.func
def noise_words(seed: wp.uint32, stream: wp.uint32, step: wp.int64, world: int, body: int) -> vec4u:
    """Four uniform words of Philox for the counter (step, world, body) and the key (seed, stream)."""
    low = wp.uint32(step & wp.int64(0xFFFFFFFF))
    high = wp.uint32(step >> wp.int64(32))
    return philox(vec4u(low, high, wp.uint32(world), wp.uint32(body)), seed, stream)


GAUSSIAN_TERMS = {False: gaussian_pair, True: gaussian_pair_fast}
"""Two deviates from two words, by whether `fast_math` is on."""
