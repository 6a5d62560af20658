"""Mobility and noise of a rigid body in the vector registers of a CPU.

What a step multiplies by is laid out once per launch as columns of eight floats, a linear part and an angular part of
four each, so that a product with the 6×6 mobility takes six vector operations in place of thirty-six. A body finds its
columns by their address; a copy of them would be made in every step.

As `otwarp.kernels.cpu.noise_block`, this is Clang's vector arithmetic and float32, without fused multiply–adds. On CUDA
these functions do not exist.
"""

import warp as wp

from otwarp.kernels.core.types import vec6

FEW_SPHERES = 8
"""Up to this many spheres of a body are laid out, too; more are where they are needed."""

FEW_TRAPS = 4
"""Aims of traps that are."""

SPHERES = 2 * 6 * 8
"""First float of the offsets: behind the columns of M dt and of the factor of the noise."""

AIMS = SPHERES + 3 * FEW_SPHERES
"""First float of the aims."""

KEPT = AIMS + 5 * FEW_TRAPS
"""Floats per body."""

VECTORS = """
#if defined(__CUDA_ARCH__)
#error "vectors of bodies are for CPUs"
#endif
#pragma clang fp contract(off)
    typedef float floats4 __attribute__((ext_vector_type(4)));
    typedef float floats8 __attribute__((ext_vector_type(8)));
"""

_KEEP = """
    float* to = buffer.data + at;
    // where (row, column) of a symmetric or lower triangular 3×3 block is kept
    const int place[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row) {
            int p = place[row][column];
            bool lower = row >= column;
            float* m = to + 8 * column + row;
            m[0] = translation[p];
            m[4] = coupling[p];
            m[24] = coupling[p];
            m[28] = rotation[p];
            m[48] = lower ? translation_root[p] : 0.0f;
            m[52] = coupling_root.data[row][column];
            m[72] = 0.0f;
            m[76] = lower ? rotation_root[p] : 0.0f;
        }
    lay_out_spheres(trapped.data + begin, end - begin, to + SPHERES);
    for (int trap = 0; trap < 4; ++trap) {
        for (int i = 0; i < 4; ++i)
            to[AIMS + 5 * trap + i] = aims.data[trap][i];
        to[AIMS + 5 * trap + 4] = reaches[trap];
    }
    return (wp::uint64)to;
"""

LAY_OUT_SPHERES = """
    auto lay_out_spheres = [](const auto* spheres, int count, float* to) {
        for (int i = 0; i < 8; ++i)
            for (int axis = 0; axis < 3; ++axis)
                to[8 * axis + i] = i < count ? spheres[i][axis] : 0.0f;
    };
"""


@wp.func_native(LAY_OUT_SPHERES + _KEEP.replace("AIMS", str(AIMS)).replace("SPHERES", str(SPHERES)))
def keep(
    buffer: wp.array(dtype=wp.float32), at: int, translation: vec6, coupling: vec6, rotation: vec6,
    translation_root: vec6, coupling_root: wp.mat33, rotation_root: vec6, aims: wp.mat44, reaches: wp.vec4,
    trapped: wp.array(dtype=wp.vec4), begin: int, end: int,
) -> wp.uint64:  # fmt: skip
    """Lay out the constants of a body from `buffer[at]` on; returns their address."""
    ...


# both parts of a twist turned from the body's frame to the world's
_OUT = """
    const floats8 first = {R00, R10, R20, 0.0f, R00, R10, R20, 0.0f};
    const floats8 second = {R01, R11, R21, 0.0f, R01, R11, R21, 0.0f};
    const floats8 third = {R02, R12, R22, 0.0f, R02, R12, R22, 0.0f};
    auto out = [&](floats8 v) {
#pragma clang fp contract(off)
        floats8 x = __builtin_shufflevector(v, v, 0, 0, 0, 0, 4, 4, 4, 4);
        floats8 y = __builtin_shufflevector(v, v, 1, 1, 1, 1, 5, 5, 5, 5);
        floats8 z = __builtin_shufflevector(v, v, 2, 2, 2, 2, 6, 6, 6, 6);
        return first * x + second * y + third * z;
    };
    auto column = [&](int k) {
        floats8 v;
        __builtin_memcpy(&v, columns + 8 * k, 32);
        return v;
    };
    auto as_twist = [](floats8 v) {
        wp::vec_t<6, wp::float32> twist;
        for (int i = 0; i < 6; ++i)
            twist[i] = v[i < 3 ? i : i + 1];
        return twist;
    };
"""
for _i in range(3):
    for _j in range(3):
        _OUT = _OUT.replace(f"R{_i}{_j}", f"turn.data[{_i}][{_j}]")

_MOBILITY = """
    const float* columns = (const float*)address;
    BODY
    float f[6];
    for (int k = 0; k < 3; ++k) {
        f[k] = turn.data[0][k] * load[0] + turn.data[1][k] * load[1] + turn.data[2][k] * load[2];
        f[k + 3] = turn.data[0][k] * load[3] + turn.data[1][k] * load[4] + turn.data[2][k] * load[5];
    }
    floats8 v = (column(0) * f[0] + column(1) * f[1] + column(2) * f[2])
        + (column(3) * f[3] + column(4) * f[4] + column(5) * f[5]);
    return as_twist(out(v));
"""

_KICKS = """
    typedef float floats16 __attribute__((ext_vector_type(16)));
    const float* m = (const float*)address + 48;
    float* block = buffer.data + at;
    floats16 x[6], v[3], w[3];
    __builtin_memcpy(x, block, sizeof(x));
    for (int row = 0; row < 3; ++row) {
        v[row] = (m[row] * x[0] + m[row + 8] * x[1] + m[row + 16] * x[2])
            + (m[row + 24] * x[3] + m[row + 32] * x[4] + m[row + 40] * x[5]);
        w[row] = (m[row + 4] * x[0] + m[row + 12] * x[1] + m[row + 20] * x[2])
            + (m[row + 28] * x[3] + m[row + 36] * x[4] + m[row + 44] * x[5]);
    }
    // `turned_along`, operation by operation
    floats16 c[3], across[3];
    for (int i = 0; i < 3; ++i)
        c[i] = part * w[i];
    floats16 share = 2.0f / (1.0f + (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]));
    for (int i = 0, j = 1, k = 2; i < 3; ++i, j = (j + 1) % 3, k = (k + 1) % 3)
        across[i] = share * (c[j] * v[k] - c[k] * v[j]);
    for (int i = 0, j = 1, k = 2; i < 3; ++i, j = (j + 1) % 3, k = (k + 1) % 3)
        v[i] = v[i] + across[i] + (c[j] * across[k] - c[k] * across[j]);
    __builtin_memcpy(block, v, sizeof(v));
    __builtin_memcpy(block + 48, w, sizeof(w));
"""

_KICK = """
    const float* from = (const float*)(kicks + 4ull * (unsigned long long)step);
    const float* columns = from;
    BODY
    auto pair = [&](int i) {
        floats8 linear = from[i], angular = from[i + 48];
        return __builtin_shufflevector(linear, angular, 0, 1, 2, 3, 12, 13, 14, 15);
    };
    return as_twist(first * pair(0) + second * pair(16) + third * pair(32));
"""


@wp.func_native((VECTORS + _MOBILITY).replace("BODY", _OUT))
def kept_mobility_product(address: wp.uint64, turn: wp.mat33, load: vec6) -> vec6:
    """M dt times a wrench [pN, pN·µm]: the move in one step [µm, rad], both in world axes."""
    ...


@wp.func_native(VECTORS + _KICKS)
def make_kicks(buffer: wp.array(dtype=wp.float32), at: int, address: wp.uint64, part: wp.float32):
    """Thermal moves √(2 k_B T dt) L ξ [µm, rad] in the body's frame in place of a block of deviates ξ from `at` on.

    Displacements are turned along by `part` as in `rotational_noise`.
    """
    ...


@wp.func_native((VECTORS + _KICK).replace("BODY", _OUT))
def kick_at(kicks: wp.uint64, turn: wp.mat33, step: wp.int64) -> vec6:
    """Thermal move of a step [µm, rad] in world axes, from a block that begins as `six_at` has it."""
    ...
