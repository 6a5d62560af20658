"""The tabulated forces of all traps on a rigid body, in the vector registers of a CPU.

Warp's kernels for CPUs are scalar code, in which a pair of a trap and a sphere costs two hundred instructions, and one
out of reach still twenty. Here the spheres of a body are lanes while it is found out which of them a trap reaches, and
a node of a table is a vector of which one lane is idle. The arithmetic is that of `trap_wrench`, `traps` and
`force_table` but for the order of an interpolation and of the sums; nothing is contracted into fused
multiply–adds, so that a force has the same bits on every CPU.

As `otwarp.kernels.cpu.noise_block`, this is Clang's vector arithmetic and float32. They do not exist on CUDA.
"""

import functools

import warp as wp

from otwarp.kernels.core.table_data import BLEND_SCALE, GridLevel
from otwarp.kernels.core.types import Aim, vec6
from otwarp.kernels.cpu.rigid_block import LAY_OUT_SPHERES, VECTORS
from otwarp.laws.table import BLEND

_LOADS = """
    typedef int ints4 __attribute__((ext_vector_type(4)));
    typedef bool bools8 __attribute__((ext_vector_type(8)));
    typedef float floats16 __attribute__((ext_vector_type(16)));
    auto load_two = [](const float* from) {
        floats4 v = 0.0f;
        __builtin_memcpy(&v, from, 8);
        return v;
    };
    auto load = [](const float* from) {
        floats4 v;
        __builtin_memcpy(&v, from, 16);
        return v;
    };
    auto load_eight = [](const float* from) {
        floats8 v;
        __builtin_memcpy(&v, from, 32);
        return v;
    };
"""

_INTERPOLATE = """
    const float* table = (const float*)node.data;
    auto node_at = [&](const float* at, const floats4& first, const floats4& second) {
        floats4 f = load(at);
        if (LAYERS > 1)
            f += first * load(at + 4);
        if (LAYERS > 2)
            f += second * load(at + 8);
        return f;
    };
    auto interpolate = [&](int start, int columns, const float* grid, floats4 place, const floats4& first,
                           const floats4& second) {
#pragma clang fp contract(off)
        // `grid` is per_spacing, and middle beside it; a load has no false dependence on earlier pairs
        floats4 scale = load_two(grid);
        floats4 uv = place * scale.xxxx + __builtin_shufflevector(scale, floats4(0.0f), 4, 1, 6, 7);
        ints4 cell = __builtin_convertvector(uv, ints4);
        floats4 part = uv - __builtin_convertvector(cell, floats4);
        int n = start + (cell.y + 1) * columns + cell.x + 1;
        const float* below = table + 4 * LAYERS * (long long)n;
        const float* above = below + 4 * LAYERS * (long long)columns;
        floats4 inner = node_at(below, first, second), outer = node_at(below + 4 * LAYERS, first, second);
        inner += part.y * (node_at(above, first, second) - inner);
        outer += part.y * (node_at(above + 4 * LAYERS, first, second) - outer);
        return inner + part.x * (outer - inner);
    };
"""

_FORCE = """
    auto at_level = [&](const auto& level, floats4 place, const floats4& first, const floats4& second) {
        return interpolate(level.node, level.columns, &level.per_spacing, place, first, second);
    };
    auto force_at = [&](int trap, int kind, floats4 place, float d2, const floats4& first, const floats4& second) {
#pragma clang fp contract(off)
        const int* nodes = (const int*)(near_nodes.data + trap * near_nodes.shape[1] + kind);
        const float* grid = (const float*)(near_grid.data + trap * near_grid.shape[1] + kind);
        float inner = BLENDf * grid[0];
        if (d2 < inner * inner)
            return interpolate(nodes[1], nodes[2], grid + 1, place, first, second);
        int which = nodes[0];
        const auto* here = level.data + level_start.data[which];
        const auto* last = level.data + level_start.data[which + 1] - 1;
        while (here < last && d2 >= here->radius * here->radius)
            ++here;
        float reach2 = here->radius * here->radius;
        // written so that a NaN is outside
        if (!(d2 < reach2))
            return floats4(0.0f);
        floats4 f = at_level(*here, place, first, second);
        inner = BLENDf * here->radius;
        if (d2 > inner * inner) {
            float x = (d2 / reach2 - BLENDf * BLENDf) * BLEND_SCALEf;
            x = x < 0.0f ? 0.0f : x > 1.0f ? 1.0f : x;
            float w = x * x * (3.0f - 2.0f * x);
            f *= 1.0f - w;
            if (here < last)
                f += w * at_level(here[1], place, first, second);
        }
        return f;
    };
"""

_BODY = """
    const float* kept = (const float*)spheres;
    floats4 force = 0.0f, torque = 0.0f;
    for (int start = begin; start < end; start += 8) {
        int count = end - start < 8 ? end - start : 8;
        alignas(32) float others[24];
        const float* offsets = kept;
        if (end - begin > 8) {
            lay_out_spheres(trapped.data + start, count, others);
            offsets = others;
        }
        floats8 ox = load_eight(offsets), oy = load_eight(offsets + 8), oz = load_eight(offsets + 16);
        auto row = [&](int i) { return turn.data[i][0] * ox + turn.data[i][1] * oy + turn.data[i][2] * oz; };
        const floats8 ax = row(0), ay = row(1), az = row(2);
        const floats8 px = ax + position[0], py = ay + position[1], pz = az + position[2];
        // the arms once more, sphere by sphere
        floats4 arms[8];
        floats8 low = __builtin_shufflevector(ax, ay, 0, 8, 1, 9, 4, 12, 5, 13);
        floats8 high = __builtin_shufflevector(ax, ay, 2, 10, 3, 11, 6, 14, 7, 15);
        arms[0] = __builtin_shufflevector(low, az, 0, 1, 8, 8);
        arms[1] = __builtin_shufflevector(low, az, 2, 3, 9, 9);
        arms[2] = __builtin_shufflevector(high, az, 0, 1, 10, 10);
        arms[3] = __builtin_shufflevector(high, az, 2, 3, 11, 11);
        arms[4] = __builtin_shufflevector(low, az, 4, 5, 12, 12);
        arms[5] = __builtin_shufflevector(low, az, 6, 7, 13, 13);
        arms[6] = __builtin_shufflevector(high, az, 4, 5, 14, 14);
        arms[7] = __builtin_shufflevector(high, az, 6, 7, 15, 15);
        for (int trap = 0; trap < TRAPS; ++trap) {
            const float* aim = (const float*)aims + 5 * trap;
            floats8 x = px - aim[0], y = py - aim[1], z = pz - aim[2];
            bools8 near = __builtin_convertvector(x * x + y * y + z * z < aim[4], bools8);
            unsigned char bits;
            __builtin_memcpy(&bits, &near, 1);
            unsigned int left = bits & ((1u << count) - 1u);
            if (left == 0)
                continue;
            INTO_FRAME
            z += near_grid.data[trap * near_grid.shape[1]][3];
            floats8 rho2 = x * x + y * y;
            floats8 d2 = rho2 + z * z;
            // on the axis F_ρ and F_φ vanish in proportion to ρ, so that any direction serves
            floats8 rho = __builtin_elementwise_sqrt(__builtin_elementwise_max(rho2, floats8(1.0e-20f)));
            floats8 per_rho = 1.0f / rho;
            alignas(32) float places[16], turns[16], away2[8];
            floats16 pairs = __builtin_shufflevector(rho, z, 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15);
            __builtin_memcpy(places, &pairs, 64);
            x *= per_rho;
            y *= per_rho;
            pairs = __builtin_shufflevector(x, y, 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15);
            __builtin_memcpy(turns, &pairs, 64);
            __builtin_memcpy(away2, &d2, 32);
            do {
                int i = __builtin_ctz(left);
                left &= left - 1u;
                floats4 place = load_two(places + 2 * i);
                floats4 cs = load_two(turns + 2 * i);
                floats4 first = 0.0f, second = 0.0f;
                TWICE
                floats4 f = force_at(trap, trapped_kind.data[start + i], place, away2[i], first, second);
                floats4 across = cs.yxzw * floats4{-1.0f, 1.0f, 0.0f, 0.0f};
                f = f.xxzz * __builtin_shufflevector(cs, floats4(1.0f), 0, 1, 4, 5) + f.yyyy * across;
                OUT_OF_FRAME
                f *= aim[3];
                force += f;
                torque += arms[i] * f.yzxw - arms[i].yzxw * f;
            } while (left != 0);
        }
    }
    wp::vec_t<6, wp::float32> wrench;
    const float both[6] = {force.x, force.y, force.z, torque.y, torque.z, torque.x};
    for (int i = 0; i < 6; ++i)
        wrench[i] = both[i];
    return wrench;
"""


# cos and sin of twice the angle, as the layers of a polarized beam need them
_TWICE = """
                float c2 = cs.x * cs.x - cs.y * cs.y, s2 = 2.0f * cs.x * cs.y;
                first = floats4{c2, s2, c2, 0.0f};
                second = floats4{s2, c2, s2, 0.0f};
"""

# into the beam's frame, of which the third axis is the cross product of the other two
_INTO_FRAME = """
            const auto& a = axis.data[trap];
            const auto& s = side.data[trap];
            const floats4 along = {a[0], a[1], a[2], 0.0f}, aside = {s[0], s[1], s[2], 0.0f};
            const floats4 up = (along * aside.yzxw - along.yzxw * aside).yzxw;
            floats8 dx = x, dy = y, dz = z;
            x = dx * aside.x + dy * aside.y + dz * aside.z;
            y = dx * up.x + dy * up.y + dz * up.z;
            z = dx * along.x + dy * along.y + dz * along.z;
"""

_OUT_OF_FRAME = "f = f.xxxx * aside + f.yyyy * up + f.zzzz * along;"


@wp.func_native("""
    return (wp::uint64)aims.data;
""")
def address_of_aims(aims: wp.array(dtype=Aim)) -> wp.uint64:
    """Address of a local array of aims."""
    ...


@functools.lru_cache(maxsize=16)
def table_wrench_term(traps: int, layers: int, upright: bool) -> wp.Function:
    """`(spheres, aims, position, turn, trapped, …) -> vec6(force, torque)` about the position, of bilinear tables.

    `spheres` is the address of what `rigid_block.keep` lays out of the body's spheres, `aims` that of the traps' aims,
    `turn` the matrix of its orientation, and `begin` to `end` are its elements of `trapped`; the rest are arrays of
    `TrapData`.

    Args:
        traps: How many.
        layers, upright: As `tabulated_term`.
    """
    source = VECTORS + _LOADS + LAY_OUT_SPHERES + _INTERPOLATE + _FORCE + _BODY
    for name, value in {
        "BLEND_SCALE": repr(float(BLEND_SCALE)),
        "BLEND": repr(BLEND),
        "LAYERS": str(layers),
        "TRAPS": str(traps),
        "INTO_FRAME": "" if upright else _INTO_FRAME,
        "OUT_OF_FRAME": "" if upright else _OUT_OF_FRAME,
        "TWICE": _TWICE if layers > 1 else "",
    }.items():
        source = source.replace(name, value)

    @wp.func_native(source)
    def table_wrench(
        spheres: wp.uint64, aims: wp.uint64, position: wp.vec3, turn: wp.mat33, trapped: wp.array(dtype=wp.vec4),
        trapped_kind: wp.array(dtype=wp.int32), begin: int, end: int, axis: wp.array(dtype=wp.vec3),
        side: wp.array(dtype=wp.vec3), near_nodes: wp.array2d(dtype=wp.vec4i), near_grid: wp.array2d(dtype=wp.vec4),
        node: wp.array(dtype=wp.vec4), level_start: wp.array(dtype=wp.int32), level: wp.array(dtype=GridLevel),
    ) -> vec6:  # fmt: skip
        """Force [pN] and torque about `position` [pN·µm] in world axes, in the vector registers of a CPU."""
        ...

    return table_wrench
