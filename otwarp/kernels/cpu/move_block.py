"""The moves of 16 lone spheres at once that noise, weight and contacts alone act on, in the vector registers of a CPU.

As scalar code such a move was 230 instructions, most of them to find where in memory things lie: half of a step of many
soft spheres. Four spheres are a vector here, and what is rare is left to the scalar code: the block moves nothing where
its spheres differ in shape, where an obstacle is near one, or where one is thrown out. The arithmetic is that of
`otwarp.kernels.drivers.grid.soft`, operation by operation, so that it does not matter which of the two a sphere meets.

As `otwarp.kernels.cpu.noise_block`, this is Clang's vector arithmetic, without fused multiply–adds; on CUDA these
functions do not exist.
"""

import functools

import warp as wp

MOVES = 16
"""Spheres of a block."""

_SOURCE = """
#if defined(__CUDA_ARCH__)
#error "moves in blocks are for CPUs"
#endif
#pragma clang fp contract(off)
    typedef float floats4 __attribute__((ext_vector_type(4)));
    typedef float floats16 __attribute__((ext_vector_type(16)));
    typedef int ints16 __attribute__((ext_vector_type(16)));
    typedef long long wholes16 __attribute__((ext_vector_type(16)));
    typedef double doubles16 __attribute__((ext_vector_type(16)));
    const int* body = order.data + (size_t)turn * order.shape[1] + i;
    int other = 0;
    // bodies are in no order, and so many words of memory far apart
    if (shapes > 1)
        for (int k = 1; k < 16; ++k)
            other |= shape.data[body[k]] ^ shape.data[body[0]];
    WALLED
    if (other)
        return 0;
    const auto* from = places.data + (size_t)row * places.shape[1] + i;
    auto* to = places.data + (size_t)(1 - row) * places.shape[1] + i;
    const floats4 pushed = {mobility, mobility, mobility, 0.0f}, moving = {1.0f, 1.0f, 1.0f, 0.0f};
    auto four = [](floats4 v) {
        return __builtin_shufflevector(v, v, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
    };
    auto swapped = [](floats16 v) {
        return __builtin_shufflevector(v, v, 1, 0, 3, 2, 5, 4, 7, 6, 9, 8, 11, 10, 13, 12, 15, 14);
    };
    auto turned = [](floats16 v) {
        return __builtin_shufflevector(v, v, 2, 3, 0, 1, 6, 7, 4, 5, 10, 11, 8, 9, 14, 15, 12, 13);
    };
    floats16 place[4];
    ints16 out = 0, far = 0;
#pragma clang loop unroll(full)
    for (int q = 0; q < 4; ++q) {
#pragma clang fp contract(off)
        const int k = 4 * q;
        floats4 x, y, z, nothing = 0.0f;
        __builtin_memcpy(&x, deviates.data + at + k, 16);
        __builtin_memcpy(&y, deviates.data + at + 16 + k, 16);
        __builtin_memcpy(&z, deviates.data + at + 32 + k, 16);
        const auto xy = __builtin_shufflevector(x, y, 0, 4, 1, 5, 2, 6, 3, 7);
        const auto zn = __builtin_shufflevector(z, nothing, 0, 4, 1, 5, 2, 6, 3, 7);
        const floats16 noise = __builtin_shufflevector(xy, zn, 0, 1, 8, 9, 2, 3, 10, 11, 4, 5, 12, 13, 6, 7, 14, 15);
        floats16 fall = 0.0f;
        WEIGHED
        wholes16 sum;
        __builtin_memcpy(&sum, push.data + i + k, 128);
        const floats16 force
            = __builtin_convertvector(__builtin_convertvector(sum, doubles16) / quanta, floats16) * four(moving);
        __builtin_memcpy(&place[q], from + k, 64);
        const floats16 before = place[q];
        place[q] = (before + (fall + spread * noise)) + four(pushed) * force;
        floats16 size = __builtin_elementwise_abs(place[q]) * four(moving);
        size += swapped(size);
        size += turned(size);
        out |= ~(size < farthest);
        floats16 base = 0.0f;
        float twelve[16] = {};
        __builtin_memcpy(twelve, reference.data + i + k, 48);
        __builtin_memcpy(&base, twelve, 64);
        floats16 away
            = place[q] - __builtin_shufflevector(base, base, 0, 1, 2, 3, 3, 4, 5, 6, 6, 7, 8, 9, 9, 10, 11, 12);
        away *= four(moving);
        away *= away;
        away += swapped(away);
        away += turned(away);
        far |= 4.0f * away > skin * skin;
    }
    if (__builtin_reduce_or(out))
        return 0;
    __builtin_memcpy(to, place, sizeof(place));
    __builtin_memset(push.data + i, 0, 16 * sizeof(push.data[0]));
    return __builtin_reduce_or(far) ? 2 : 1;
"""

_WALLED = """
    for (int k = 0; k < 16; ++k)
        other |= walled.data[i + k];
"""

_WEIGHED = """
        for (int l = 0; l < 4; ++l)
            fall[4 * l + 2] = mobility * -weight.data[body[k + l]];
"""


@functools.lru_cache(maxsize=4)
def move_block_term(gravity: bool, obstacles: bool) -> wp.Function:
    """`(places, row, order, turn, i, shape, shapes, weight, walled, spread, mobility, quanta, farthest, deviates, at,
    push, reference, skin) -> int`.

    Moves the spheres in the slots i … i + 15 from the present places to the next: by `spread` [µm] times the deviates
    that `otwarp.kernels.drivers.grid.move.body_block_term` left at `at`, and by `mobility` [µm/pN] times their weight
    [pN] and contact force, whose sums (`quanta` in one pN) begin anew.

    Args:
        gravity: Whether they have a weight.
        obstacles: Whether some may be near an obstacle.
    """
    source = _SOURCE.replace("WALLED", _WALLED if obstacles else "").replace("WEIGHED", _WEIGHED if gravity else "")

    @wp.func_native(source)
    def move_block(
        places: wp.array2d(dtype=wp.vec4), row: int, order: wp.array2d(dtype=wp.int32), turn: int, i: int,
        shape: wp.array(dtype=wp.int32), shapes: int, weight: wp.array(dtype=wp.float32),
        walled: wp.array(dtype=wp.int32), spread: float, mobility: float, quanta: wp.float64, farthest: float,
        deviates: wp.array(dtype=wp.float32), at: int, push: wp.array(dtype=wp.vec4l),
        reference: wp.array(dtype=wp.vec3), skin: float,
    ) -> int:  # fmt: skip
        """0: nothing has moved; 1: all have; 2: and one of them by more than half the skin [µm] since `reference`."""
        ...

    return move_block
