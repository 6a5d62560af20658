"""What the exact force of one beam on one sphere is computed from, in float64 whatever the precision of the rest."""

import warp as wp

ROW = 8
"""Multipoles n that one row of `ExactData.table` holds, and that one sweep over the nodes sums."""


@wp.struct
class ExactData:
    """One beam and one sphere.

    R rules of quadrature serve points within `extent`; K nodes and B rows belong to one rule. Rows of the same |m|
    follow one another and hold eight consecutive n, the first from max(|m|, 1); zeros fill the last one.
    """

    wavenumber: wp.float64  # k in the medium [rad/µm]
    orders: wp.int32  # N + 1: highest multipole that couples to those of the sphere
    charge: wp.int32  # ℓ
    right: wp.float64  # |E₊|²
    left: wp.float64  # |E₋|², right + left = 1
    mixed: wp.vec2d  # E₊* E₋
    extent: wp.array(dtype=wp.float64)  # (R) largest k·distance that a rule serves, ascending
    node_start: wp.array(dtype=wp.int32)  # (R + 1) first node of each rule
    table_start: wp.array(dtype=wp.int64)  # (R) first entry of each rule in `table`
    cosine: wp.array(dtype=wp.float64)  # (nodes of all rules) cos t_q
    sine: wp.array(dtype=wp.float64)  # sin t_q, ascending within a rule
    weight: wp.array(dtype=wp.vec2d)  # 2π w_q A(t_q) sin t_q over the square root of the beam's power
    row_start: wp.array(dtype=wp.int32)  # (N + 3) first row of each |m|
    first_node: wp.array2d(dtype=wp.int32)  # (R, B) node before which a row's angular functions vanish
    table: wp.array(dtype=wp.float64)  # (row, node, σ = 1 then −1, n) √((2n+1)/4π) d^n_{|m|σ}
    root: wp.array(dtype=wp.float64)  # √(i − 1), and 0 at i = 0
    same: wp.array(dtype=wp.vec2d)  # (N + 3) response of n and n − 1 to waves of one helicity
    cross: wp.array(dtype=wp.vec2d)  # (N + 3) the same between helicities
    turn: wp.array(dtype=wp.vec2d)  # (N + 3) response of electric with magnetic waves of n, over n(n + 1)
    room: wp.array(dtype=wp.vec2d)  # of a GPU's threads, see `kernels.optics.exact_room`; (0) on a CPU
