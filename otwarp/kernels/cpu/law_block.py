"""The laws of eight contacts at once, in the vector registers of a CPU.

A contact's tangent is a chain of roots and quotients that waits for itself: 150 cycles, of which a scalar processor
fills few. Contacts of the same two bodies are lanes here, and their sum is all that the solver takes. The arithmetic is
that of `otwarp.kernels.contact.implicit_law` but for the order of sums, and a lane's depth is what it would be alone.

As `otwarp.kernels.cpu.noise_block`, this is Clang's vector arithmetic and float32, without fused multiply–adds. On CUDA
these functions do not exist.
"""

import functools
from typing import Any

import warp as wp

from otwarp.kernels.cpu.rigid_block import VECTORS

vec9: Any = wp.types.vector(length=9, dtype=wp.float32)

_LOADS = """
    typedef int ints8 __attribute__((ext_vector_type(8)));
    floats8 sums[9] = {};
    for (int start = begin; start < end; start += 8) {
    // what lies behind the last contact is that contact again
    auto at = [&](int lane) { return start + lane < end ? start + lane : end - 1; };
    auto pair_of = [&](const auto& rows, int lane) {
        floats4 low, high;
        __builtin_memcpy(&low, &wp::index(rows, at(lane)), 16);
        __builtin_memcpy(&high, &wp::index(rows, at(lane + 4)), 16);
        return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    };
    auto columns_of = [&](const auto& rows, floats8* column) {
        const floats8 a = pair_of(rows, 0), b = pair_of(rows, 1), c = pair_of(rows, 2), d = pair_of(rows, 3);
        const floats8 ab = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
        const floats8 cd = __builtin_shufflevector(c, d, 0, 8, 1, 9, 4, 12, 5, 13);
        column[0] = __builtin_shufflevector(ab, cd, 0, 1, 8, 9, 4, 5, 12, 13);
        column[1] = __builtin_shufflevector(ab, cd, 2, 3, 10, 11, 6, 7, 14, 15);
        const floats8 under = __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
        const floats8 below = __builtin_shufflevector(c, d, 2, 10, 3, 11, 6, 14, 7, 15);
        column[2] = __builtin_shufflevector(under, below, 0, 1, 8, 9, 4, 5, 12, 13);
        column[3] = __builtin_shufflevector(under, below, 2, 3, 10, 11, 6, 7, 14, 15);
    };
    floats8 faces[4], laws[4], wander, layer, guess;
    columns_of(face, faces);
    columns_of(law, laws);
    for (int lane = 0; lane < 8; ++lane) {
        wander[lane] = wp::index(path, at(lane))[0];
        layer[lane] = wp::index(path, at(lane))[1];
        guess[lane] = wp::index(depth, at(lane));
    }
    const floats8 overlap = laws[0], hardness = laws[1], give = laws[2], floor = laws[3], zero = 0.0f;
    const floats8 quarter = 0.25f * wander, yields = give * hardness, gap = layer - overlap;
    const floats8 opening = faces[3] + (faces[0] * way[0] + faces[1] * way[1] + faces[2] * way[2]);
    const ints8 wanders = wander > 0.0f;
    floats8 deep, load, slope;
"""

# `first_line`
_FIRST = """
    if (first) {
        const floats8 apart = opening + give * floor;
        const floats8 larger = 0.5f * (__builtin_elementwise_abs(apart) + ROOT(apart * apart + wander));
        const floats8 smaller = quarter / larger;
        const ints8 meets = wanders & ((apart < 0.0f ? smaller : larger) > layer);
        const floats8 reach = overlap + (meets ? (apart > 0.0f ? smaller : larger) - layer : -apart);
        const ints8 carries = reach > 0.0f;
        floats8 w = ROOT(reach / (1.0f + yields * ROOT(reach)));
        for (int i = 0; i < 3; ++i)
            w = w - (w * w + yields * w * w * w - reach) / (2.0f * w + 3.0f * yields * w * w);
        deep = carries ? w * w : zero;
        const floats8 root = ROOT(deep), carried = floor + hardness * deep * root;
        const floats8 inverse = 1.0f / (opening + give * carried + deep + gap);
        const floats8 bend = quarter * inverse * inverse;
        slope = 1.5f * hardness * root;
        slope = meets ? slope * (bend / (1.5f * yields * root + 1.0f + bend)) : slope;
        slope = carries ? slope : zero;
        load = carries ? carried * (1.0f + give * slope) : floor;
    } else {
"""

# `tangent`
_TANGENT = """
        const floats8 least = MOST(overlap - opening, zero);
        floats8 follows = overlap > opening ? floats8(1.0f) : zero;
        deep = least;
        const floats8 reach = yields * least * ROOT(least) + least + gap;
        const ints8 meets = wanders & (reach * (opening + least + gap) < quarter);
        if (__builtin_reduce_or(meets)) {
            ints8 left = meets;
            deep = meets ? MOST(guess, least) : least;
            for (int i = 0; i < DEPTH_ROUNDS; ++i) {
                const floats8 root = ROOT(deep), inverse = 1.0f / (opening + deep + gap), kept = quarter * inverse;
                const floats8 fall = 1.0f / (1.5f * yields * root + 1.0f + kept * inverse);
                const floats8 step = (yields * deep * root + deep + gap - kept) * fall;
                deep = left ? MOST(deep - step, least) : deep;
                follows = left ? kept * inverse * fall : follows;
                left &= ~(__builtin_elementwise_abs(step) <= DEPTH_TOLERANCEf * deep);
                if (!__builtin_reduce_or(left))
                    break;
            }
        }
        const floats8 root = ROOT(deep);
        load = floor + hardness * deep * root;
        slope = 1.5f * hardness * root * follows;
    }
"""

_SUMS = """
    const ints8 number = {0, 1, 2, 3, 4, 5, 6, 7};
    const ints8 counts = number < end - start;
    load = counts ? load : zero;
    slope = counts ? slope : zero;
    for (int lane = 0; lane < 8 && start + lane < end; ++lane)
        wp::index(depth, start + lane) = deep[lane];
    const floats8 x = slope * faces[0], y = slope * faces[1];
    sums[0] += x * faces[0];
    sums[1] += x * faces[1];
    sums[2] += x * faces[2];
    sums[3] += y * faces[1];
    sums[4] += y * faces[2];
    sums[5] += slope * faces[2] * faces[2];
    for (int axis = 0; axis < 3; ++axis)
        sums[6 + axis] += load * faces[axis];
    }
    wp::vec_t<9, wp::float32> all;
    for (int i = 0; i < 9; ++i) {
        const floats4 four = sums[i].lo + sums[i].hi;
        all[i] = (four.x + four.z) + (four.y + four.w);
    }
    return all;
"""


@functools.lru_cache(maxsize=1)
def sum_lines_term(depth_rounds: int, depth_tolerance: float) -> wp.Function:
    """`(face, law, path, depth, begin, end, way, first) -> vec9` of some contacts of the same two bodies.

    The arrays are those of a `ContactList`, `way` [µm] is how far the bodies have moved apart; writes the depths.

    Args:
        depth_rounds, depth_tolerance: As in `implicit_law`.
    """
    source = VECTORS + _LOADS + _FIRST + _TANGENT + _SUMS
    for name, value in {
        "DEPTH_ROUNDS": str(depth_rounds),
        "DEPTH_TOLERANCE": repr(depth_tolerance),
        "ROOT": "__builtin_elementwise_sqrt",
        "MOST": "__builtin_elementwise_max",
    }.items():
        source = source.replace(name, value)

    @wp.func_native(source)
    def sum_lines(
        face: wp.array(dtype=wp.vec4), law: wp.array(dtype=wp.vec4), path: wp.array(dtype=wp.vec2),
        depth: wp.array(dtype=wp.float32), begin: int, end: int, way: wp.vec3, first: bool,
    ) -> vec9:  # fmt: skip
        """Σ k nnᵀ [pN/µm], as its entries xx, xy, xz, yy, yz, zz, and then Σ λ n [pN]."""
        ...

    return sum_lines
