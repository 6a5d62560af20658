"""Pairs of spheres that are near each other, found in the vector registers of a CPU.

What takes a CPU's time here is not arithmetic but branches that it cannot foresee: how many spheres are in a cell, how
many of them are near, and which of these touch. A run of sorted spheres is therefore tested 16 at a time, however short
it is, and of the pairs of a list those that touch are picked without a branch. Next come places and constants that lie
anywhere in memory, since bodies are in no order: they are asked for before they are needed. A pair is a word, 16·j + k:
sphere j beside the k-th of a block of 16. As `otwarp.kernels.cpu.noise_block`, this is Clang's vector arithmetic,
without fused multiply–adds; on CUDA these functions do not exist.
"""

import functools

import warp as wp

from otwarp.kernels.core.types import PeriodData

PAIRS = 16
"""Spheres of a block, and how many are tested at once; so much room must follow what is read and written."""

_START = """
#if defined(__CUDA_ARCH__)
#error "pairs in blocks are for CPUs"
#endif
#pragma clang fp contract(off)
"""

# the nearest image, as `otwarp.kernels.core.periodic.nearest`
_WRAP = "AWAY = AWAY - __builtin_elementwise_rint(AWAY * period.per_length[AXIS]) * period.length[AXIS];"

_NEAR = """
    typedef float floats16 __attribute__((ext_vector_type(16)));
    typedef int ints16 __attribute__((ext_vector_type(16)));
    typedef bool bits16 __attribute__((ext_vector_type(16)));
    const ints16 lane = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    auto column = [&](int c, int s) {
        floats16 v;
        __builtin_memcpy(&v, sorted.data + (size_t)c * sorted.shape[1] + s, 64);
        return v;
    };
    int found = 0;
    // each pair is listed once, with the sphere that comes first
    auto search = [&](int first, int last) {
#pragma clang fp contract(off)
        for (int s = first > i + 1 ? first : i + 1; s < last; s += 16) {
        floats16 x = here[0] - column(0, s), y = here[1] - column(1, s), z = here[2] - column(2, s);
        WRAPPED
        floats16 radius = column(3, s), both = far + radius;
        ints16 near = (x * x + y * y + z * z < both * both) & (radius > 0.0f) & (lane < last - s);
        bits16 chosen = __builtin_convertvector(near != 0, bits16);
        unsigned short bits;
        __builtin_memcpy(&bits, &chosen, 2);
        ints16 pair = (lane + s) * 16 + k;
        int* to = list.data + at + (found < most ? found : most);
#if defined(__AVX512F__)
        pair = __builtin_ia32_compresssi512_mask(pair, pair, bits);
        __builtin_memcpy(to, &pair, 64);
#else
        for (unsigned int left = bits; left; left &= left - 1)
            *to++ = pair[__builtin_ctz(left)];
#endif
        found += __builtin_popcount(bits);
        }
    };
    // of cells twice as wide as they need be the nearer two hold all that is near, else three; those along z follow
    // each other
    auto first_of = [&](int axis, bool wide) {
        const float place = here[axis] / edge[axis];
        return cell[axis] - (!wide || place - __builtin_floorf(place) < 0.5f ? 1 : 0);
    };
    const bool wide_x = edge[0] > 2.0f * edge[2], wide_y = edge[1] > 2.0f * edge[2];
    const int left = first_of(0, wide_x), right = left + (wide_x ? 2 : 3);
    const int front = first_of(1, wide_y), back = front + (wide_y ? 2 : 3);
    const int bottom = cell[2] - 1, deep = cells[2] - 1;
    const bool inside = (cell[2] & deep) > 0 && (cell[2] & deep) < deep;
    for (int x = left; x < right; ++x)
        for (int y = front; y < back; ++y) {
            const int column = (world * cells[0] + (x & (cells[0] - 1))) * cells[1] + (y & (cells[1] - 1));
            const int base = column * cells[2];
            if (inside)
                search(start.data[base + (bottom & deep)], finish.data[base + (bottom & deep) + 2]);
            else
                for (int z = bottom; z < bottom + 3; ++z)
                    search(start.data[base + (z & deep)], finish.data[base + (z & deep)]);
        }
    return found;
"""

_AMONG = """
    typedef float floats16 __attribute__((ext_vector_type(16)));
    typedef int ints16 __attribute__((ext_vector_type(16)));
    typedef bool bits16 __attribute__((ext_vector_type(16)));
    const ints16 lane = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    auto column = [&](int c, int s) {
        floats16 v;
        __builtin_memcpy(&v, sorted.data + (size_t)c * sorted.shape[1] + s, 64);
        return v;
    };
    int found = 0;
    for (int s = first; s < last; s += 16) {
        floats16 x = here[0] - column(0, s), y = here[1] - column(1, s), z = here[2] - column(2, s);
        WRAPPED
        floats16 radius = column(3, s), both = far + radius;
        ints16 other = (lane < own_first - s) | (lane >= own_last - s);
        ints16 near = (x * x + y * y + z * z < both * both) & (radius > 0.0f) & (lane < last - s) & other;
        bits16 chosen = __builtin_convertvector(near != 0, bits16);
        unsigned short bits;
        __builtin_memcpy(&bits, &chosen, 2);
        for (unsigned int left = bits; left; left &= left - 1, ++found)
            if (found < most)
                list.data[at + found] = s + __builtin_ctz(left);
    }
    return found;
"""

_SORT = """
    const int all = cells[0] * cells[1] * cells[2], base = world * all;
    int* ends = finish.data + base;
    const auto* place = places.data + (size_t)row * places.shape[1];
    auto* to = places.data + (size_t)(1 - row) * places.shape[1];
    const int* from_body = order.data + (size_t)turn * order.shape[1];
    int* to_body = order.data + (size_t)(1 - turn) * order.shape[1];
    auto along = [&](float x, int axis) {
        const float c = __builtin_floorf(x / edge[axis]);
        return (int)(c < -1.0e9f ? -1.0e9f : c > 1.0e9f ? 1.0e9f : c) & (cells[axis] - 1);
    };
    for (int c = 0; c < all; ++c)
        ends[c] = 0;
    for (int i = first; i < last; ++i) {
        key.data[i] = (along(place[i][0], 0) * cells[1] + along(place[i][1], 1)) * cells[2] + along(place[i][2], 2);
        ++ends[key.data[i]];
    }
    for (int c = 0, at = first; c < all; ++c) {
        start.data[base + c] = at;
        at += ends[c];
        ends[c] = start.data[base + c];
    }
    for (int i = first; i < last; ++i) {
        const int at = ends[key.data[i]]++;
        to[at] = place[i];
        to_body[at] = from_body[i];
        for (int c = 0; c < 4; ++c)
            sorted.data[(size_t)c * sorted.shape[1] + at] = place[i][c];
    }
"""

_TOUCHING = """
    const auto* place = places.data + (size_t)row * places.shape[1];
    const int before = found;
    for (int p = begin; p < end; ++p) {
        const int pair = list.data[p], i = first + (pair & 15), j = pair >> 4;
        __builtin_prefetch(place + (list.data[p + 16] >> 4));
        const auto& one = place[i];
        const auto& other = place[j];
        float x = one[0] - other[0], y = one[1] - other[1], z = one[2] - other[2];
        WRAPPED
        const float far = (one[3] + other[3]) + reach;
        chosen.data[2 * found] = i;
        chosen.data[2 * found + 1] = j;
        found += x * x + y * y + z * z < far * far;
    }
    auto body = [&](int j) { return order.data[(size_t)turn * order.shape[1] + j]; };
    for (int i = first; i < first + count; ++i)
        __builtin_prefetch(shape.data + body(i));
    for (int t = 2 * before; t < 2 * found; ++t) {
        const int b = body(chosen.data[t]);
        __builtin_prefetch(compliance.data + b);
        __builtin_prefetch(adhesion.data + b);
        __builtin_prefetch(range.data + b);
    }
    return found;
"""


def _source(text: str, periodic: bool) -> str:
    """C++ of a block, with the nearest images where space repeats."""
    wraps = [_WRAP.replace("AWAY", axis).replace("AXIS", str(n)) for n, axis in enumerate("xyz")]
    return _START + text.replace("WRAPPED", "\n".join(wraps) if periodic else "")


@functools.lru_cache(maxsize=2)
def near_term(periodic: bool) -> wp.Function:
    """`(period, sorted, start, finish, edge, cells, world, cell, here, far, i, k, list, at, most) -> int`.

    Writes the spheres around sphere i that come after it, from the cells around its own, to its list, which begins at
    `at`: so each pair is listed once.
    """

    @wp.func_native(_source(_NEAR, periodic))
    def near(
        period: PeriodData, sorted: wp.array2d(dtype=wp.float32), start: wp.array(dtype=wp.int32),
        finish: wp.array(dtype=wp.int32), edge: wp.vec3, cells: wp.vec3i, world: int, cell: wp.vec3i, here: wp.vec3,
        far: float, i: int, k: int, list: wp.array(dtype=wp.int32), at: int, most: int,
    ) -> int:  # fmt: skip
        """How many after i are closer to `here` than `far` and their radius [µm]; `most` are kept."""
        ...

    return near


@functools.lru_cache(maxsize=2)
def among_term(periodic: bool) -> wp.Function:
    """`(period, sorted, first, last, own_first, own_last, here, far, list, at, most) -> int`.

    Writes those of the spheres first … last − 1 that are near and not own_first … own_last − 1 to a list, which begins
    at `at`: their numbers, ascending.
    """

    @wp.func_native(_source(_AMONG, periodic))
    def among(
        period: PeriodData, sorted: wp.array2d(dtype=wp.float32), first: int, last: int, own_first: int, own_last: int,
        here: wp.vec3, far: float, list: wp.array(dtype=wp.int32), at: int, most: int,
    ) -> int:  # fmt: skip
        """How many are closer to `here` than `far` and their radius [µm]; `most` are kept."""
        ...

    return among


@functools.lru_cache(maxsize=2)
def touching_term(periodic: bool) -> wp.Function:
    """`(period, places, row, first, count, list, begin, end, reach, order, turn, shape, compliance, adhesion, range,
    chosen, found) -> found`.

    Appends those of the listed pairs begin … end − 1 of `count` spheres from `first` on that are within reach of each
    other to the `found` ones that there are: number of the sphere, and of the other. Asks memory for what the step then
    reads of the bodies.
    """

    @wp.func_native(_source(_TOUCHING, periodic))
    def touching(
        period: PeriodData, places: wp.array2d(dtype=wp.vec4), row: int, first: int, count: int,
        list: wp.array(dtype=wp.int32), begin: int, end: int, reach: float, order: wp.array2d(dtype=wp.int32),
        turn: int, shape: wp.array(dtype=wp.int32), compliance: wp.array(dtype=wp.float32),
        adhesion: wp.array(dtype=wp.float32), range: wp.array(dtype=wp.float32), chosen: wp.array(dtype=wp.int32),
        found: int,
    ) -> int:  # fmt: skip
        """How many pairs there are then; the gap of those appended is less than `reach` [µm]."""
        ...

    return touching


@wp.func_native(_START + _SORT)
def sort_slots(
    places: wp.array2d(dtype=wp.vec4), row: int, order: wp.array2d(dtype=wp.int32), turn: int, first: int, last: int,
    edge: wp.vec3, cells: wp.vec3i, world: int, key: wp.array(dtype=wp.int32), start: wp.array(dtype=wp.int32),
    finish: wp.array(dtype=wp.int32), sorted: wp.array2d(dtype=wp.float32),
):  # fmt: skip
    """Sort the slots first … last − 1 of a world by cell into the other rows of `places` [µm] and `order`, in turn.

    Writes where each cell starts and finishes, and the sorted places component by component.
    """
    ...
