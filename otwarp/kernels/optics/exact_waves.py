"""Waves and multipoles of a focused beam seen from one point: the sums over nodes of `otwarp.kernels.optics.exact`.

Complex numbers are `vec2d`; notation as there.
"""

import warp as wp

from otwarp.kernels.core.exact_data import ROW, ExactData

SMALLEST = wp.constant(wp.float64(1e-14))
"""Least argument of a Bessel function: closer to the axis than any position matters."""

SEED = wp.constant(wp.float64(1e-100))
"""First value of the downward recurrence; J₀ is at most 1e60 times larger before normalisation."""


@wp.func
def times(a: wp.vec2d, b: wp.vec2d) -> wp.vec2d:
    """Complex product a·b, numbers as (real, imaginary)."""
    return wp.vec2d(a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0])


@wp.func
def conj_times(a: wp.vec2d, b: wp.vec2d) -> wp.vec2d:
    """Complex product a*·b of the conjugate of a with b."""
    return wp.vec2d(a[0] * b[0] + a[1] * b[1], a[0] * b[1] - a[1] * b[0])


@wp.func
def conj(a: wp.vec2d) -> wp.vec2d:
    """Complex conjugate a* = (real, −imaginary)."""
    return wp.vec2d(a[0], -a[1])


@wp.func
def times_i(a: wp.vec2d) -> wp.vec2d:
    """Complex product i·a = (−imaginary, real)."""
    return wp.vec2d(-a[1], a[0])


@wp.func
def last_bessel_order(x: wp.float64) -> int:
    """Even j beyond which |J_j(x)| < 1e-15, from the decay of J_j over a range of x^(1/3) (checked up to x = 600)."""
    return 2 * int(wp.float64(0.5) * (x + wp.float64(10.0) * wp.cbrt(x) + wp.float64(5.0)))


@wp.func
def start_waves(
    data: ExactData, offset: int, nodes: int, room: int, k_rho: wp.float64, k_z: wp.float64, top: int,
    begun: wp.array(dtype=wp.vec2d), wave: wp.array(dtype=wp.vec2d),
):  # fmt: skip
    """Put G_{top+1} and G_top, or the first order of G that does not vanish, into slots j mod 3 of `wave`.

    Miller's downward recurrence, normalised with 1 = J₀ + 2 Σ J_2k (Gautschi 1967, doi:10.1137/1009002); `begun`
    receives the order at which each node's recurrence begins, and 2/x with x = kρ sin t_q.
    """
    for q in range(nodes):
        x = wp.max(k_rho * data.sine[offset + q], SMALLEST)
        last = last_bessel_order(x)
        factor = wp.float64(2.0) / x
        above = wp.float64(0.0)
        # a copy: the constant itself as a loop variable would change for all its users
        seed = SEED
        here = wp.float64(1.0) * seed
        zeroth = wp.float64(0.0)
        total = wp.float64(0.0)
        high = wp.float64(0.0)
        low = wp.float64(0.0)
        # two orders at a time, the even one first; the last pair ends with J₋₁
        for pair in range(last // 2 + 1):
            j = last - 2 * pair
            between = factor * wp.float64(j) * here - above
            if j == top:
                high = above
                low = here
            if j == top + 1:
                high = here
                low = between
            zeroth = here
            total += here
            above = between
            here = factor * wp.float64(j - 1) * between - here
        phase = k_z * data.cosine[offset + q]
        size = wp.float64(1.0) / (wp.float64(2.0) * total - zeroth)
        carrier = size * times(data.weight[offset + q], wp.vec2d(wp.cos(phase), wp.sin(phase)))
        begun[q] = wp.vec2d(wp.float64(last), factor)
        for slot in range(3):
            value = wp.float64(0.0)
            if last <= top:
                if slot == last % 3:
                    value = seed
            elif slot == top % 3:
                value = low
            elif slot == (top + 1) % 3:
                value = high
            wave[slot * room + q] = value * carrier


@wp.func
def lower_waves(
    room: int, order: int, begin: int, end: int, begun: wp.array(dtype=wp.vec2d), wave: wp.array(dtype=wp.vec2d)
):
    """G_{j−1} = (2j/x) G_j − G_{j+1} for `order` j at the nodes from `begin` to `end`."""
    above = ((order + 1) % 3) * room
    here = (order % 3) * room
    below = ((order + 2) % 3) * room
    factor = wp.float64(order)
    for q in range(begin, end):
        wave[below + q] = (factor * begun[q][1]) * wave[here + q] - wave[above + q]


SUM_ROW = f"""
#if defined(__clang__)
#pragma clang fp contract(fast)
#endif
    const double* d_a = (const double*)__builtin_assume_aligned(table.data + entry + at_a, 16);
    const double* d_b = (const double*)__builtin_assume_aligned(table.data + entry + at_b, 16);
#if defined(__CUDA_ARCH__)
    // threads keep their numbers in turns
    const int step = wave.strides[0] / sizeof(double);
#else
    const int step = 2;
#endif
    const double* g_a = (const double*)wave.data + step * low;
    const double* g_b = (const double*)wave.data + step * high;
    double a_re[{ROW}] = {{}}, a_im[{ROW}] = {{}}, b_re[{ROW}] = {{}}, b_im[{ROW}] = {{}};
    for (int q = 0; q < count; ++q, d_a += {2 * ROW}, d_b += {2 * ROW}) {{
        const double x = g_a[step * q], y = g_a[step * q + 1], u = g_b[step * q], v = g_b[step * q + 1];
        for (int i = 0; i < {ROW}; ++i) {{
            a_re[i] += x * d_a[i];
            a_im[i] += y * d_a[i];
            b_re[i] += u * d_b[i];
            b_im[i] += v * d_b[i];
        }}
    }}
    double* out_a = (double*)a.data + step * n;
    double* out_b = (double*)b.data + step * n;
    for (int i = 0; i < {ROW}; ++i) {{
        out_a[step * i] = sign * a_re[i];
        out_a[step * i + 1] = sign * a_im[i];
        out_b[step * i] = sign * b_re[i];
        out_b[step * i + 1] = sign * b_im[i];
    }}
"""
"""Most of all arithmetic. In C++ because Warp's indexing (strides, negative indices) hides from the compiler that the
entries of a row are neighbours: on a CPU, where the loops over i become vectors, a point takes half the time it took
with the same loop in Python. Rows begin at multiples of 128 bytes. CUDA contracts to multiply-adds unasked."""


@wp.func_native(SUM_ROW)
def sum_row(
    table: wp.array(dtype=wp.float64), wave: wp.array(dtype=wp.vec2d), entry: wp.int64, at_a: int, at_b: int, low: int,
    high: int, count: int, sign: wp.float64, n: int, a: wp.array(dtype=wp.vec2d), b: wp.array(dtype=wp.vec2d),
):  # fmt: skip
    """A and B of one row, into `a` and `b` from index `n` on: Σ over `count` nodes from `entry` of the table on."""


@wp.func
def sum_waves(
    data: ExactData, rule: int, nodes: int, m: int, begin: int, low: int, high: int, wave: wp.array(dtype=wp.vec2d),
    now: int, a: wp.array(dtype=wp.vec2d), b: wp.array(dtype=wp.vec2d),
):  # fmt: skip
    """A_n and B_n of one m for all n, into `a` and `b` from `now` on; their waves start at `low` and `high`."""
    across = wp.abs(m)
    lowest = wp.max(across, 1)
    # d^n_{−m,−σ} = (−1)^{m−σ} d^n_{mσ}: below m = 0 the helicities change places in the table
    at_a = int(0)
    sign = wp.float64(1.0)
    if m < 0:
        at_a = wp.static(ROW)
        if across % 2 == 0:
            sign = wp.float64(-1.0)
    for n in range(wp.max(lowest - 2, 0), lowest):
        a[now + n] = wp.vec2d()
        b[now + n] = wp.vec2d()
    first_row = data.row_start[across]
    for row in range(first_row, data.row_start[across + 1]):
        first = wp.max(begin, data.first_node[rule, row])
        entry = data.table_start[rule] + wp.int64(wp.static(2 * ROW)) * wp.int64(row * nodes + first)
        n = now + lowest + wp.static(ROW) * (row - first_row)
        at_b = wp.static(ROW) - at_a
        sum_row(data.table, wave, entry, at_a, at_b, low + first, high + first, nodes - first, sign, n, a, b)
