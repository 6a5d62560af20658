"""Exact optical force on a sphere (generalised Lorenz–Mie theory) in float64: one point per thread.

Notation: σ = ±1 helicity, (n, m) multipole, t_q quadrature nodes of the polar angle, w_q their weights with the beam's
amplitude, (ρ, φ, z) the sphere's centre from the focus, ℓ the beam's azimuthal charge. With the waves
G_j(q) = w_q exp(ikz cos t_q) J_j(kρ sin t_q) the incident coefficients are, but for a phase that φ and m fix,

    A_n = Σ_q G_{m−1−ℓ} d^n_{m,1}(t_q)   (σ = 1),      B_n = Σ_q G_{m+1−ℓ} d^n_{m,−1}(t_q)   (σ = −1).

Three facts make this cheap. J_j falls steeply beyond j = kρ, and the recurrence in j runs downwards along with m, so a
thread keeps three orders of G and two of A and B, whatever the number of multipoles. As d^n_{−m,−σ} = (−1)^{m−σ}
d^n_{mσ} and J_{−j} = (−1)^j J_j, the coefficients of m < ℓ are those of −m > −ℓ of a beam of charge −ℓ with the
helicities exchanged: one side is evaluated, and for ℓ = 0 it is also the other. And the sphere's response enters the
balance of momentum only through products of neighbours, so that scattered coefficients are never formed.

The momentum balance is that of Gouesbet, Maheu, Gréhan 1988, doi:10.1364/JOSAA.5.001427, in the helicity basis.
Complex numbers are `vec2d`.
"""

import functools

import warp as wp

from otwarp.kernels.core.exact_data import ExactData
from otwarp.kernels.optics.exact_room import own_part, room_of, row_of
from otwarp.kernels.optics.exact_waves import (
    conj,
    conj_times,
    last_bessel_order,
    lower_waves,
    start_waves,
    sum_waves,
    times,
    times_i,
)


@wp.struct
class SideSums:
    """Sums over m ≥ ℓ of what the force needs; A and B are the sums' helicities."""

    axial_a: wp.float64
    axial_b: wp.float64
    axial_ab: wp.vec2d
    radial_a: wp.vec2d
    radial_b: wp.vec2d
    radial_ab: wp.vec2d
    radial_ba: wp.vec2d


@wp.func
def balance(
    data: ExactData, m: int, now: int, above: int, share: wp.float64, a: wp.array(dtype=wp.vec2d),
    b: wp.array(dtype=wp.vec2d), sums: SideSums,
) -> SideSums:  # fmt: skip
    """Add the momentum that the waves of m exchange among each other (axial, times `share`) and with m + 1 (radial).

    cos t couples n to n ± 1 at the same m, sin t exp(ip) couples them from m to m + 1; the factors are those of
    `along_axis` and `across_axis` of otwarp.optics.harmonics.
    """
    out = sums
    two = wp.float64(2.0)
    spin = two * share * wp.float64(m)
    lowest = wp.max(wp.min(wp.abs(m), wp.abs(m + 1)), 1)
    # what n − 1 and n leave for n and n + 1
    a_below = a[now + lowest - 1]
    b_below = b[now + lowest - 1]
    a_here = a[now + lowest]
    b_here = b[now + lowest]
    same = data.same[lowest]
    for n in range(lowest, data.orders + 1):
        a_next = a[now + n + 1]
        b_next = b[now + n + 1]
        turn = data.turn[n]
        same_next = data.same[n + 1]
        minus = data.root[n - m + 1]
        plus = data.root[n + m + 1]
        up = plus * data.root[n + m + 2]
        down = minus * data.root[n - m + 2]
        level = two * minus * data.root[n + m + 2]
        step = two * share * minus * plus
        a_same = times(same, a_below)
        b_same = times(same, b_below)
        out.axial_a += step * conj_times(a_here, a_same)[0] + spin * turn[0] * wp.dot(a_here, a_here)
        out.axial_b += step * conj_times(b_here, b_same)[0] - spin * turn[0] * wp.dot(b_here, b_here)
        a_moved = down * conj_times(same_next, a_next) - up * a_same + (level * turn[0]) * a_here
        b_moved = down * conj_times(same_next, b_next) - up * b_same - (level * turn[0]) * b_here
        out.radial_a += conj_times(a[above + n], a_moved)
        out.radial_b += conj_times(b[above + n], b_moved)
        if data.mixed[0] != wp.float64(0.0) or data.mixed[1] != wp.float64(0.0):
            cross = data.cross[n]
            cross_next = data.cross[n + 1]
            a_cross = times(cross, a_below)
            b_cross = times(cross, b_below)
            exchange = conj_times(a_here, b_cross) + conj(conj_times(b_here, a_cross))
            out.axial_ab += step * exchange - (two * spin * turn[1]) * times_i(conj_times(a_here, b_here))
            a_turned = down * conj_times(cross_next, a_next) - up * a_cross + (level * turn[1]) * times_i(a_here)
            b_turned = down * conj_times(cross_next, b_next) - up * b_cross - (level * turn[1]) * times_i(b_here)
            out.radial_ab += conj_times(a[above + n], b_turned)
            out.radial_ba += conj_times(b[above + n], a_turned)
        a_below = a_here
        b_below = b_here
        a_here = a_next
        b_here = b_next
        same = same_next
    return out


@wp.func
def together(data: ExactData, one: SideSums, other: SideSums, k_x: wp.float64, k_y: wp.float64) -> wp.vec3d:
    """Dimensionless force Q in the beam's frame from the sums of both sides, at the azimuth of (k_x, k_y).

    With c = E₊* E₋ exp(−2iφ) each side has F_z = |E₊|² z_A + |E₋|² z_B − Re c z_AB, and F_x + iF_y is exp(iφ) times
    three constants and their products with c and c*: all there is of the azimuth and of the polarization.
    """
    k_rho = wp.sqrt(k_x * k_x + k_y * k_y)
    turn = wp.vec2d(wp.float64(1.0), wp.float64(0.0))
    if k_rho > wp.float64(0.0):
        turn = wp.vec2d(k_x / k_rho, k_y / k_rho)
    c = conj_times(times(turn, turn), data.mixed)
    axial = data.right * (one.axial_a + other.axial_b) + data.left * (one.axial_b + other.axial_a)
    axial -= times(c, one.axial_ab)[0] + conj_times(c, other.axial_ab)[0]
    radial = data.right * (one.radial_a - conj(other.radial_b)) + data.left * (one.radial_b - conj(other.radial_a))
    radial -= times(c, one.radial_ab - conj(other.radial_ab)) + conj_times(c, one.radial_ba - conj(other.radial_ba))
    across = times(turn, -times_i(radial))
    return wp.vec3d(across[0], across[1], axial)


def side_sums_term(orders: int, nodes: int, shared: bool) -> wp.Function:
    """Function `(data, rule, charge, kρ, kz) -> SideSums` with room for `orders` and `nodes`, as `exact_force_term`."""
    room, whole = row_of(orders), room_of(orders, nodes)

    @wp.func
    def side_sums(data: ExactData, rule: int, charge: int, k_rho: wp.float64, k_z: wp.float64) -> SideSums:
        """Sums over m from `charge` up, with J_{m−1−charge} and J_{m+1−charge}."""
        if wp.static(shared):
            begun = own_part(data.room, wp.static(whole), 0, wp.static(nodes))
            wave = own_part(data.room, wp.static(whole), wp.static(nodes), wp.static(3 * nodes))
            a = own_part(data.room, wp.static(whole), wp.static(4 * nodes), wp.static(2 * room))
            b = own_part(data.room, wp.static(whole), wp.static(4 * nodes + 2 * room), wp.static(2 * room))
        else:
            begun = wp.zeros(shape=wp.static(nodes), dtype=wp.vec2d)
            wave = wp.zeros(shape=wp.static(3 * nodes), dtype=wp.vec2d)
            a = wp.zeros(shape=wp.static(2 * room), dtype=wp.vec2d)
            b = wp.zeros(shape=wp.static(2 * room), dtype=wp.vec2d)
        sums = SideSums()
        offset = data.node_start[rule]
        count = data.node_start[rule + 1] - offset
        highest = data.orders - charge
        # beyond `top` the waves of all nodes vanish
        top = wp.min(highest, last_bessel_order(k_rho) + 1)
        if top >= 0:
            start_waves(data, offset, count, wp.static(nodes), k_rho, k_z, top, begun, wave)
        begin = count
        while begin > 0 and begun[wp.max(begin - 1, 0)][0] >= wp.float64(top):
            begin -= 1
        # all threads count down from the same order, so that neighbours read the same rows of the table
        for back in range(highest - wp.max(-data.orders - charge, 0) + 1):
            order = highest - back
            if order <= top:
                lower_waves(wp.static(nodes), order, begin, count, begun, wave)
                while begin > 0 and begun[wp.max(begin - 1, 0)][0] >= wp.float64(order - 1):
                    begin -= 1
                now = (order % 2) * wp.static(room)
                above = ((order + 1) % 2) * wp.static(room)
                low = ((order + 2) % 3) * wp.static(nodes)
                high = ((order + 1) % 3) * wp.static(nodes)
                m = order + charge
                sum_waves(data, rule, count, m, begin, low, high, wave, now, a, b)
                # both sides reach m = charge
                share = wp.float64(1.0)
                if order == 0:
                    share = wp.float64(0.5)
                sums = balance(data, m, now, above, share, a, b, sums)
        return sums

    return side_sums


@functools.lru_cache(maxsize=32)
def exact_force_term(orders: int, nodes: int, shared: bool = False) -> wp.Function:
    """Force term `(data: ExactData, displacement: vec3d) -> vec3d` with room for `orders` and `nodes`.

    The displacement is that of the sphere's centre from the focus in the frame of the beam [µm]; the result is the
    dimensionless force Q in that frame. Beyond the extent of the last rule the force is zero.

    Args:
        orders: At least `ExactData.orders`.
        nodes: At least the nodes of every rule.
        shared: Of a GPU: threads keep what they need in parts of `ExactData.room`, of `room_of(orders, nodes)` each.
    """
    side_sums = side_sums_term(orders, nodes, shared)

    @wp.func
    def exact_force(data: ExactData, displacement: wp.vec3d) -> wp.vec3d:
        """Dimensionless force Q in the beam's frame at a displacement from the focus [µm]; see `exact_force_term`."""
        place = data.wavenumber * displacement
        distance = wp.length(place)
        rule = int(0)
        while rule < data.extent.shape[0] and distance > data.extent[wp.min(rule, data.extent.shape[0] - 1)]:
            rule += 1
        force = wp.vec3d()
        if rule < data.extent.shape[0]:
            k_rho = wp.sqrt(place[0] * place[0] + place[1] * place[1])
            one = SideSums()
            other = SideSums()
            # without charge the sides are each other's mirror image
            for side in range(1 + wp.min(wp.abs(data.charge), 1)):
                other = side_sums(data, rule, data.charge * (1 - 2 * side), k_rho, place[2])
                if side == 0:
                    one = other
            force = together(data, one, other, place[0], place[1])
        return force

    return exact_force


@functools.lru_cache(maxsize=32)
def exact_force_kernel(orders: int, nodes: int, shared: bool = False) -> wp.Kernel:
    """Kernel `(data, points, first, force)`: Q at `points[first + thread]`; see `exact_force_term`."""
    term = exact_force_term(orders, nodes, shared)

    @wp.kernel(module="unique", enable_backward=False)
    def exact_force_at(data: ExactData, points: wp.array(dtype=wp.vec3d), first: int, force: wp.array(dtype=wp.vec3d)):
        """Write the dimensionless force Q in the beam's frame at `points[first + thread]` [µm]."""
        i = first + wp.tid()
        force[i] = term(data, points[i])

    return exact_force_at
