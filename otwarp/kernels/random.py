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


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __umulhi(a, b);
#else
    return (wp::uint32)(((wp::uint64)a * (wp::uint64)b) >> 32);
#endif
""")
def multiply_high(a: wp.uint32, b: wp.uint32) -> wp.uint32:
    """Upper half of the product. Written as a 64-bit product, half of Philox compiles to 64-bit multiplications."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return x * rsqrtf(fmaxf(x, 1.0e-30f));
#else
    return sqrtf(x);
#endif
""")
def square_root(x: wp.float32) -> wp.float32:
    """√x of 0 ≤ x < 100, relative error < 3e-7: on CUDA one instruction, without the path for subnormal numbers."""
    ...


@wp.func
def philox(counter: vec4u, seed: wp.uint32, stream: wp.uint32) -> vec4u:
    """Philox4x32-10: four independent uniform 32-bit words for a counter and a key (seed, stream)."""
    c0, c1, c2, c3 = counter[0], counter[1], counter[2], counter[3]
    k0, k1 = seed, stream
    for _ in range(wp.static(_ROUNDS)):
        n0 = multiply_high(_M1, c2) ^ c1 ^ k0
        n2 = multiply_high(_M0, c0) ^ c3 ^ k1
        c1 = _M1 * c2
        c3 = _M0 * c0
        c0 = n0
        c2 = n2
        k0 = k0 + _W0
        k1 = k1 + _W1
    return vec4u(c0, c1, c2, c3)


@wp.func
def natural_log(x: wp.float32) -> wp.float32:
    """ln x for normal x > 0, relative error < 2e-7: x = m·2ᵉ with m in [√½, √2), ln(1 + f) = f − f²/2 + f³·P(f).

    The coefficients of P are a minimax fit of relative error; plain arithmetic, so that compilers can schedule and
    vectorise it, where the library's logarithm is a call on the CPU.
    """
    bits = wp.cast(x, wp.int32)
    exponent = (bits - wp.int32(0x3F3504F3)) >> 23
    f = wp.cast(bits - (exponent << 23), wp.float32) - 1.0
    p = 0.12761654 - 0.07634545 * f
    p = p * f - 0.13160201
    p = p * f + 0.14201749
    p = p * f - 0.16623355
    p = p * f + 0.20001227
    p = p * f - 0.25000821
    p = p * f + 0.33333332
    return wp.float32(exponent) * 0.69314718 + (f - 0.5 * f * f + f * f * f * p)


@wp.func
def turn_cosine_sine(turn: wp.uint32) -> wp.vec2:
    """(cos, sin) of 2π·(turn + ½)·2⁻³², absolute error < 1e-7.

    The quadrant and the rest, within ±π/4, come from the integer exactly, so no argument needs reducing in floating
    point (on a GPU the library's slow path for that costs registers and local memory).
    """
    quadrant = (turn + wp.uint32(0x20000000)) >> wp.uint32(30)
    rest = wp.int32(turn - (quadrant << wp.uint32(30)))
    r = (wp.float32(rest) + 0.5) * 1.4629180792671596e-09
    z = r * r
    sine = r + r * z * (-0.16666655 + z * (0.00833216 - 0.00019515 * z))
    cosine = 1.0 - 0.5 * z + z * z * (0.0416666457 + z * (-0.00138873162 + 2.44331474e-05 * z))
    odd = (quadrant & wp.uint32(1)) != wp.uint32(0)
    x = wp.where(odd, sine, cosine)
    y = wp.where(odd, cosine, sine)
    # quadrants 1 and 2 lie left of the axis, 2 and 3 below
    left = quadrant == wp.uint32(1) or quadrant == wp.uint32(2)
    return wp.vec2(wp.where(left, -x, x), wp.where(quadrant >= wp.uint32(2), -y, y))


@wp.func
def gaussian_pair(a: wp.uint32, b: wp.uint32) -> wp.vec2:
    """Two standard normal deviates from two words (Box and Muller 1958, doi:10.1214/aoms/1177706645).

    u = (word + ½)·2⁻³² lies in (0, 1], so the logarithm is finite; the largest deviate is √(2 ln 2³³) ≈ 6.8.
    """
    square = -2.0 * natural_log((wp.float32(a) + 0.5) * _TO_UNIT)
    return square_root(wp.max(square, 0.0)) * turn_cosine_sine(b)


@wp.func
def gaussian_pair_fast(a: wp.uint32, b: wp.uint32) -> wp.vec2:
    """The same deviates by the library's functions, which `fast_math` turns into single instructions on CUDA.

    Absolute error near 1e-6 for all but the largest deviates; on a CPU the same accuracy as `gaussian_pair`, slower.
    """
    square = -2.0 * wp.log((wp.float32(a) + 0.5) * _TO_UNIT)
    # half a turn to either side: the intrinsics reduce no arguments
    angle = wp.float32(wp.int32(b)) * 1.4629180792671596e-09
    return square_root(wp.max(square, 0.0)) * wp.vec2(wp.cos(angle), wp.sin(angle))


@wp.func
def noise_words(seed: wp.uint32, stream: wp.uint32, step: wp.int64, world: int, body: int) -> vec4u:
    """The four words that belong to (stream, step, world, body)."""
    low = wp.uint32(step & wp.int64(0xFFFFFFFF))
    high = wp.uint32(step >> wp.int64(32))
    return philox(vec4u(low, high, wp.uint32(world), wp.uint32(body)), seed, stream)


GAUSSIAN_TERMS = {False: gaussian_pair, True: gaussian_pair_fast}
"""Two deviates from two words, by whether `fast_math` is on."""
