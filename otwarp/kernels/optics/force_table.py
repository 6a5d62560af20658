"""Tabulated optical forces: interpolation on nested (ρ, z) grids.

What the grids and layers are, and why two dimensions hold the whole field, is described in `otwarp.optics.table`, whose
`ForceTable.force` is the float64 twin of what is here.
"""

import warp as wp

from otwarp.kernels.core.cells import cell_of, cell_start
from otwarp.kernels.core.roots import reciprocal_root, square_root
from otwarp.kernels.core.table_data import BLEND_SCALE, ForceTableData, GridLevel
from otwarp.laws.table import BLEND

mat32 = wp.types.matrix(shape=(3, 2), dtype=wp.float32)


@wp.func
def blend_weight(d2: float, radius: float) -> float:
    """Share in [0, 1] of what lies beyond `radius` [µm]: a smooth step in distance² d2 [µm²] from `BLEND`·radius on."""
    x = wp.clamp((d2 / (radius * radius) - BLEND * BLEND) * BLEND_SCALE, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


@wp.func_native("""
    auto row = nodes.data + n;
#if defined(__CUDA_ARCH__)
    if constexpr (sizeof(*row) == sizeof(float4)) {
        // whole, so that it is one load
        float4 node = __ldg(reinterpret_cast<const float4*>(row) + after);
        return {node.x, node.y, node.z};
    }
#endif
    return {row[after][0], row[after][1], row[after][2]};
""")
def node_at(nodes: wp.array(dtype=wp.vec4), n: int, after: int) -> wp.vec3:
    """The node by `after` after node n [pN per mW], without the strides of Warp, so that both share an address."""
    ...


@wp.func
def one_layer(tables: ForceTableData, node: int, after: int, first: wp.vec3, second: wp.vec3) -> wp.vec3:
    """F_ρ, F_φ, F_z [pN per mW] of the node by `after` after `node` in a beam of one helicity."""
    return node_at(tables.node, node, after)


@wp.func
def two_layers(tables: ForceTableData, node: int, after: int, first: wp.vec3, second: wp.vec3) -> wp.vec3:
    """F_ρ, F_φ, F_z [pN per mW] of the node in a polarized beam; `first` = (cos 2φ, sin 2φ, cos 2φ)."""
    n = 2 * node
    k = 2 * after
    return node_at(tables.node, n, k) + wp.cw_mul(first, node_at(tables.node, n, k + 1))


@wp.func
def three_layers(tables: ForceTableData, node: int, after: int, first: wp.vec3, second: wp.vec3) -> wp.vec3:
    """F_ρ, F_φ, F_z [pN per mW] of the node in a polarized vortex; `second` = (sin 2φ, cos 2φ, sin 2φ)."""
    n = 3 * node
    k = 3 * after
    polarized = wp.cw_mul(first, node_at(tables.node, n, k + 1)) + wp.cw_mul(second, node_at(tables.node, n, k + 2))
    return node_at(tables.node, n, k) + polarized


NODE_TERMS = {1: one_layer, 2: two_layers, 3: three_layers}


def bilinear_term(layers: int) -> wp.Function:
    """`(tables, level, rho, z, first, second) -> (F_ρ, F_φ, F_z)` by linear interpolation along both axes."""
    at = NODE_TERMS[layers]

    @wp.func
    def bilinear(
        tables: ForceTableData, level: GridLevel, rho: float, z: float, first: wp.vec3, second: wp.vec3
    ) -> wp.vec3:
        """F_ρ, F_φ, F_z [pN per mW] at (ρ, z) [µm] from the four nodes around."""
        u = rho * level.per_spacing
        v = z * level.per_spacing + level.middle
        i = cell_of(u)
        j = cell_of(v)
        a = u - cell_start(u)
        b = v - cell_start(v)
        n = level.node + (j + 1) * level.columns + i + 1
        both = a * b
        total = (1.0 - a - (b - both)) * at(tables, n, 0, first, second)
        total += (a - both) * at(tables, n, 1, first, second)
        n += level.columns
        total += (b - both) * at(tables, n, 0, first, second)
        return total + both * at(tables, n, 1, first, second)

    return bilinear


@wp.func
def cubic_weights(t: float) -> wp.vec4:
    """Weights of nodes −1 … 2 at offset t ∈ [0, 1] in a cell: cubic B-spline (Unser 1999, doi:10.1109/79.799930)."""
    s = 1.0 - t
    t2 = t * t
    s2 = s * s
    return wp.vec4(
        s * s2 * (1.0 / 6.0),
        2.0 / 3.0 - t2 + 0.5 * t * t2,
        2.0 / 3.0 - s2 + 0.5 * s * s2,
        t * t2 * (1.0 / 6.0),
    )


def bicubic_term(layers: int) -> wp.Function:
    """`(tables, level, rho, z, first, second) -> (F_ρ, F_φ, F_z)` by cubic B-splines along both axes."""
    at = NODE_TERMS[layers]

    @wp.func
    def bicubic(
        tables: ForceTableData, level: GridLevel, rho: float, z: float, first: wp.vec3, second: wp.vec3
    ) -> wp.vec3:
        """F_ρ, F_φ, F_z [pN per mW] at (ρ, z) [µm] from the sixteen nodes around."""
        u = rho * level.per_spacing
        v = z * level.per_spacing + level.middle
        i = cell_of(u)
        j = cell_of(v)
        wu = cubic_weights(u - cell_start(u))
        wv = cubic_weights(v - cell_start(v))
        n = level.node + j * level.columns + i
        total = wp.vec3(0.0)
        for k in range(4):
            row = wu[0] * at(tables, n, 0, first, second)
            row += wu[1] * at(tables, n, 1, first, second)
            row += wu[2] * at(tables, n, 2, first, second)
            row += wu[3] * at(tables, n, 3, first, second)
            total += wv[k] * row
            n += level.columns
        return total

    return bicubic


INTERPOLATIONS = {"bilinear": bilinear_term, "bicubic": bicubic_term}


def table_term(interpolation: str, layers: int) -> wp.Function:
    """`(tables, table, finest, x, y, z) -> force per mW` in the beam's frame [µm, pN].

    x is along the major axis of the polarization, `finest` the first level of the table, which the caller may hold on
    to.
    """
    interpolate = INTERPOLATIONS[interpolation](layers)

    @wp.func
    def outer_level(tables: ForceTableData, table: int, d2: float) -> int:
        """Index of the finest level whose radius is beyond the squared distance d2 [µm²], else of the last."""
        level = tables.level_start[table]
        last = tables.level_start[table + 1] - 1
        while level < last and d2 >= tables.level[level].radius * tables.level[level].radius:
            level += 1
        return level

    @wp.func
    def table_force(tables: ForceTableData, table: int, finest: GridLevel, x: float, y: float, z: float) -> wp.vec3:
        """Force [pN per mW] at (x, y, z) [µm] in the beam's frame, from its cylindrical components."""
        rho2 = x * x + y * y
        # on the axis F_ρ and F_φ vanish in proportion to ρ, so that any direction serves
        per_rho = reciprocal_root(wp.max(rho2, 1.0e-20))
        rho = square_root(rho2)
        c = x * per_rho
        s = y * per_rho
        first = wp.vec3(0.0)
        second = wp.vec3(0.0)
        if wp.static(layers > 1):
            c2 = c * c - s * s
            s2 = 2.0 * c * s
            first = wp.vec3(c2, s2, c2)
            second = wp.vec3(s2, c2, s2)
        d2 = rho2 + z * z
        inner = BLEND * finest.radius
        f = wp.vec3(0.0)
        if d2 < inner * inner:
            f = interpolate(tables, finest, rho, z, first, second)
        else:
            level = outer_level(tables, table, d2)
            here = tables.level[level]
            # written so that a NaN is outside
            if d2 < here.radius * here.radius:
                w = blend_weight(d2, here.radius)
                parts = int(1)
                if w > 0.0 and level < tables.level_start[table + 1] - 1:
                    parts = 2
                # a loop, so that the interpolation stands here once
                weight = float(1.0) - w
                for _ in range(parts):
                    f += weight * interpolate(tables, here, rho, z, first, second)
                    if parts == 2:
                        here = tables.level[level + 1]
                    weight = w
        return wp.vec3(f[0] * c - f[1] * s, f[0] * s + f[1] * c, f[2])

    return table_force


def cell_slopes_term(interpolation: str, layers: int) -> wp.Function:
    """`(tables, level, rho, z, first, second) -> (3, 2) ∂(F_ρ, F_φ, F_z)/∂(ρ, z)` of one level [pN/µm per mW].

    Central differences over a cell of what the force interpolates, which smooths over the cell's size. The
    exponential integrator stays right whatever stiffness it is given; a closer one lets it take longer steps.
    """
    interpolate = INTERPOLATIONS[interpolation](layers)

    @wp.func
    def cell_slopes(
        tables: ForceTableData, level: GridLevel, rho: float, z: float, first: wp.vec3, second: wp.vec3
    ) -> mat32:
        """Slopes over half a cell to either side; the field is mirrored at the axis, F_ρ and F_φ odd and F_z even."""
        h = 0.5 / level.per_spacing
        inner = wp.max(rho - h, 0.0)
        along_rho = (
            interpolate(tables, level, rho + h, z, first, second) - interpolate(tables, level, inner, z, first, second)
        ) / (rho + h - inner)
        along_z = level.per_spacing * (
            interpolate(tables, level, rho, z + h, first, second)
            - interpolate(tables, level, rho, z - h, first, second)
        )
        return wp.matrix_from_cols(along_rho, along_z)

    return cell_slopes


def table_stiffness_term(interpolation: str, layers: int) -> wp.Function:
    """`(tables, table, place) -> mat33` symmetric part of −∂F/∂x in the beam's frame [pN/µm per mW].

    Args:
        interpolation, layers: As `table_term`. `place` is (x, y, z) from the focus, x along the major axis of the
            polarization [µm].
    """
    interpolate = INTERPOLATIONS[interpolation](layers)
    slopes_at = cell_slopes_term(interpolation, layers)

    @wp.func
    def table_stiffness(tables: ForceTableData, table: int, place: wp.vec3) -> wp.mat33:
        """−∂F/∂x [pN/µm per mW] from cylindrical derivatives of the level that serves, without blending."""
        level = tables.level_start[table]
        last = tables.level_start[table + 1] - 1
        distance = wp.length(place)
        while level < last and distance >= BLEND * tables.level[level].radius:
            level += 1
        grid = tables.level[level]
        # at least two cells from the rim, so that differences stay on the grid
        stiffness = wp.mat33(0.0)
        if distance < grid.radius - 2.0 / grid.per_spacing:
            rho = wp.max(wp.sqrt(place[0] * place[0] + place[1] * place[1]), 1.0e-3 / grid.per_spacing)
            c = place[0] / rho
            s = place[1] / rho
            if c * c + s * s < 0.5:
                c = 1.0
                s = 0.0
            c2 = c * c - s * s
            s2 = 2.0 * c * s
            first = wp.vec3(c2, s2, c2)
            second = wp.vec3(s2, c2, s2)
            f = interpolate(tables, grid, rho, place[2], first, second)
            turned = wp.vec3(0.0)
            if wp.static(layers > 1):
                # what is left of the layers that do not depend on φ cancels in this difference
                along = wp.vec3(-2.0 * s2, 2.0 * c2, -2.0 * s2)
                across = wp.vec3(2.0 * c2, -2.0 * s2, 2.0 * c2)
                zero = wp.vec3(0.0)
                turned = interpolate(tables, grid, rho, place[2], along, across)
                turned -= interpolate(tables, grid, rho, place[2], zero, zero)
            d = slopes_at(tables, grid, rho, place[2], first, second)
            k_rf = -0.5 * (d[1, 0] + (turned[0] - f[1]) / rho)
            k_rz = -0.5 * (d[0, 1] + d[2, 0])
            k_fz = -0.5 * (d[1, 1] + turned[2] / rho)
            k_ff = -(f[0] + turned[1]) / rho
            local = wp.mat33(-d[0, 0], k_rf, k_rz, k_rf, k_ff, k_fz, k_rz, k_fz, -d[2, 1])
            turn = wp.mat33(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
            stiffness = turn * local * wp.transpose(turn)
        return stiffness

    return table_stiffness
