"""The deviates of one body for 16 steps at once, in the vector registers of a CPU.

Warp's kernels for CPUs are scalar code, of which Gaussian noise takes most of the time. The counter of the noise is
(step, world, body), so that the next 16 steps of a body are 16 independent lanes: this is Philox, logarithm, root, sine
and cosine of `otwarp.kernels.core.random` written for lanes, while the physics stays scalar and reads the deviates one
step at a time. No lane knows of another and nothing is contracted into fused multiply–adds, which the compiler does
not do in Warp's scalar code either: a deviate has the same bits here, there, and on every CPU, wherever a block starts.

The vectors are those of Clang, the only compiler Warp has for CPUs, which turns them into AVX-512, AVX2 or NEON as the
machine has it; Warp's cache tells machines apart by their features. On CUDA these functions do not exist.
"""

import functools
from typing import Literal

import warp as wp

from otwarp.kernels.core.noise import LOWER, POINT, STEP, UPPER
from otwarp.kernels.core.random import Stream
from otwarp.kernels.core.types import vec6

BLOCK = 16
"""Steps drawn at once."""

_CPU_ONLY = """
#if defined(__CUDA_ARCH__)
#error "blocks of noise are for CPUs"
#endif
#pragma clang fp contract(off)
"""

# Lanes of 64 bits hold what a wide product needs in place, and upper halves that need not be cleared until the end.
# More than eight at a time would not fit AVX2's registers.
_PHILOX = """
    typedef unsigned int words8 __attribute__((ext_vector_type(8)));
    typedef unsigned long long wide8 __attribute__((ext_vector_type(8)));
    alignas(64) unsigned int words[4 * 16];
    auto philox = [&](unsigned int stream) {
        const wide8 lane = {0, 1, 2, 3, 4, 5, 6, 7};
        const wide8 low = 0xFFFFFFFFull;
#pragma clang loop unroll(full)
        for (int k = 0; k < 16; k += 8) {
            LANE_NAMESwide8 step = LANE_STEP;
            wide8 c0 = step & low, c1 = step >> 32;
            wide8 c2 = LANE_WORLD, c3 = LANE_BODY;
            unsigned int k0 = seed, k1 = stream;
#pragma clang loop unroll(full)
            for (int round = 0; round < 10; ++round) {
                wide8 p0 = (c0 & low) * 0xD2511F53ull;
                wide8 p1 = (c2 & low) * 0xCD9E8D57ull;
                c0 = (p1 >> 32) ^ c1 ^ (unsigned long long)k0;
                c2 = (p0 >> 32) ^ c3 ^ (unsigned long long)k1;
                c1 = p1;
                c3 = p0;
                k0 += 0x9E3779B9u;
                k1 += 0xBB67AE85u;
            }
            words8 w0 = __builtin_convertvector(c0, words8), w1 = __builtin_convertvector(c1, words8);
            words8 w2 = __builtin_convertvector(c2, words8), w3 = __builtin_convertvector(c3, words8);
            // radii side by side, angles side by side
            __builtin_memcpy(words + k, &w0, sizeof(w0));
            __builtin_memcpy(words + 16 + k, &w2, sizeof(w2));
            __builtin_memcpy(words + 32 + k, &w1, sizeof(w1));
            __builtin_memcpy(words + 48 + k, &w3, sizeof(w3));
        }
    };
"""

# The arithmetic of `squared_radius` and `polar`, operation by operation. Both pairs of four deviates go together (n =
# 32), because it takes that many independent lanes to hide how long each operation takes.
_GAUSSIAN = """
    typedef unsigned int words{n} __attribute__((ext_vector_type({n})));
    typedef int ints{n} __attribute__((ext_vector_type({n})));
    typedef float floats{n} __attribute__((ext_vector_type({n})));
    auto gaussian{n} = [&](floats{n}& cosines, floats{n}& sines) {{
#pragma clang fp contract(off)
        words{n} word, turn;
        __builtin_memcpy(&word, words, sizeof(word));
        __builtin_memcpy(&turn, words + 32, sizeof(turn));
        ints{n} bits = (ints{n})(__builtin_convertvector(word, floats{n}) + 0.5f);
        ints{n} exponent = (bits - 0x4F3504F3) >> 23;
        floats{n} f = (floats{n})(bits - (exponent << 23) - 0x10000000) - 1.0f;
        floats{n} p = 0.28534987f - 0.1740088f * f;
        p = p * f - 0.29829539f;
        p = p * f + 0.33155168f;
        p = p * f - 0.39926127f;
        p = p * f + 0.50002674f;
        p = p * f - 0.66667821f;
        floats{n} f2 = f * f;
        floats{n} square = __builtin_convertvector(exponent, floats{n}) * -1.3862944f + (f2 + f * f2 * p - 2.0f * f);
        floats{n} radius = __builtin_elementwise_sqrt(square);
        floats{n} t = __builtin_convertvector((ints{n})(turn << 1), floats{n}) * 2.3283064365386963e-10f
            + 1.1641532182693481e-10f;
        floats{n} z = t * t;
        floats{n} sine
            = t * (3.14159258f + z * (-5.16770688f + z * (2.55003138f + z * (-0.59804518f + z * 0.07722014f))));
        floats{n} cosine = 1.0f + z * (-4.93479552f + z * (4.05845134f + z * (-1.33209388f + z * 0.22008069f)));
        floats{n} spread = (floats{n})((words{n})radius ^ ((turn + 0x40000000u) & 0x80000000u));
        cosines = spread * cosine;
        sines = spread * sine;
    }};
"""

_WEAK = """
    typedef unsigned int words16 __attribute__((ext_vector_type(16)));
    typedef int ints16 __attribute__((ext_vector_type(16)));
    typedef float floats16 __attribute__((ext_vector_type(16)));
    const int places[3] = {0, 32, 16};
    auto weak = [&](int index) {
#pragma clang fp contract(off)
        words16 word;
        __builtin_memcpy(&word, words + places[index / 2], sizeof(word));
        ints16 half = (ints16)(index % 2 ? word : word << 16);
        floats16 x = DEVIATE;
        __builtin_memcpy(to + 16 * index, &x, sizeof(x));
    };
#pragma clang loop unroll(full)
    for (int i = 0; i < COUNT; ++i)
        weak(i);
"""

# comparisons of vectors are masks
_DEVIATES = {
    "threePoint": "(floats16)(((half >= (ints16)UPPER) & (ints16)(floats16)POINTf)"
    " | ((half < (ints16)LOWER) & (ints16)(floats16)-POINTf))",
    "uniform": "(__builtin_convertvector(half >> 16, floats16) + 0.5f) * STEPf",
}

_THREE_GAUSSIAN = """
    floats32 c, s;
    philox(BROWNIAN_A);
    gaussian32(c, s);
    __builtin_memcpy(to, &c, 64);
    __builtin_memcpy(to + 16, &s, 64);
    __builtin_memcpy(to + 32, (const char*)&c + 64, 64);
"""

_SIX_GAUSSIAN = """
    __builtin_memcpy(to + 48, (const char*)&s + 64, 64);
    floats16 c4, s4;
    philox(BROWNIAN_B);
    gaussian16(c4, s4);
    __builtin_memcpy(to + 64, &c4, 64);
    __builtin_memcpy(to + 80, &s4, 64);
"""


_LANES = {
    "steps": {
        "LANE_ROOM": "buffer.data + at",
        "LANE_NAMES": "",
        "LANE_STEP": "(unsigned long long)first + (unsigned long long)k + lane",
        "LANE_WORLD": "(unsigned long long)(unsigned int)world + 0 * lane",
        "LANE_BODY": "(unsigned long long)(unsigned int)body",
    },
    "bodies": {
        "LANE_ROOM": "buffer.data + room",
        "LANE_NAMES": """wide8 names;
            for (int l = 0; l < 8; ++l) {
                const int one = k + l < count ? k + l : count - 1;
                names[l] = (unsigned long long)(unsigned int)bodies.data[at + one];
            }
            """,
        "LANE_STEP": "(unsigned long long)first + 0 * lane",
        "LANE_WORLD": "(unsigned long long)(unsigned int)world + 0 * lane",
        "LANE_BODY": "names",
    },
    "worlds": {
        "LANE_ROOM": "buffer.data + at",
        "LANE_NAMES": "",
        "LANE_STEP": "(unsigned long long)first + 0 * lane",
        "LANE_WORLD": "((unsigned long long)(unsigned int)world + (unsigned long long)k + lane) & low",
        "LANE_BODY": "0 * lane",
    },
}
"""What the 16 lanes of a block are: steps of one body, or bodies in one step, or worlds."""


def block_source(noise: str, count: int, lanes: Literal["steps", "bodies", "worlds"] = "steps") -> str:
    """C++ of the block function of `count` deviates per lane, a key of `_LANES`."""
    source = _CPU_ONLY + "    float* to = LANE_ROOM;\n" + _PHILOX
    if noise == "gaussian":
        source += _GAUSSIAN.format(n=32) + (_GAUSSIAN.format(n=16) if count == 6 else "")
        source += _THREE_GAUSSIAN + (_SIX_GAUSSIAN if count == 6 else "")
    else:
        source += "    philox(BROWNIAN_A);\n" + _WEAK.replace("DEVIATE", _DEVIATES[noise])
    for name, text in _LANES[lanes].items():
        source = source.replace(name, text)
    names = {"UPPER": UPPER, "LOWER": LOWER, "POINT": POINT, "STEP": STEP, "COUNT": count}
    for name, value in names.items():
        source = source.replace(name, repr(getattr(value, "value", value)))
    for stream in (Stream.BROWNIAN_A, Stream.BROWNIAN_B):
        source = source.replace(stream.name, f"{int(stream)}u")
    return source


@functools.lru_cache(maxsize=8)
def noise_block_term(noise: str, count: int) -> wp.Function:
    """`(buffer, at, seed, first, world, body)`: the deviates of a body for the steps first … first + 15.

    Deviate c of step first + k goes to `buffer[at + 16 c + k]` and has the bits that `three_deviates_term` (count 3) or
    `six_deviates_term` (count 6) give for that step.

    Args:
        noise: One of `NOISES`.
        count: Deviates per step, 3 or 6.
    """

    @wp.func_native(block_source(noise, count))
    def noise_block(
        buffer: wp.array(dtype=wp.float32), at: int, seed: wp.uint32, first: wp.int64, world: int, body: int
    ):
        """Write 16 steps of `count` deviates of mean 0 and variance 1, in the vector registers of a CPU."""
        ...

    return noise_block


@functools.lru_cache(maxsize=4)
def worlds_block_term(noise: str) -> wp.Function:
    """`(buffer, at, seed, step, world)`: the deviates of body 0 of 16 worlds from `world` on, in one step.

    Deviate c of world + k goes to `buffer[at + 16 c + k]`.

    Args:
        noise: One of `NOISES`.
    """

    @wp.func_native(block_source(noise, 3, "worlds"))
    def worlds_block(buffer: wp.array(dtype=wp.float32), at: int, seed: wp.uint32, first: wp.int64, world: int):
        """Write three deviates of mean 0 and variance 1 for each of 16 worlds, in a CPU's vector registers."""
        ...

    return worlds_block


@wp.func_native("""
    return (wp::uint64)(buffer.data + at);
""")
def address_of(buffer: wp.array(dtype=wp.float32), at: int) -> wp.uint64:
    """Address of element `at`, by which a struct can hold on to a local array."""
    ...


@wp.func_native("""
    return address - 4ull * (unsigned long long)step;
""")
def before_step(address: wp.uint64, step: wp.int64) -> wp.uint64:
    """Where the deviates of step 0 would be, by which a step finds its own in a block that begins with `step`."""
    ...


@wp.func_native("""
    const float* from = (const float*)(address + 4ull * (unsigned long long)step);
    return wp::vec_t<3, wp::float32>(from[0], from[16], from[32]);
""")
def three_at(address: wp.uint64, step: wp.int64) -> wp.vec3:
    """The three deviates of mean 0 and variance 1 of a step, whose block `address` counts from step 0."""
    ...


@wp.func_native("""
    const float* from = (const float*)(address + 4ull * (unsigned long long)step);
    wp::vec_t<6, wp::float32> deviates;
    for (int c = 0; c < 6; ++c)
        deviates[c] = from[16 * c];
    return deviates;
""")
def six_at(address: wp.uint64, step: wp.int64) -> vec6:
    """The six deviates of mean 0 and variance 1 of a step, as `three_at`."""
    ...
