"""Tabulated optical forces: interpolation on nested (ρ, z) grids.

What the grids and layers are, and why two dimensions hold the whole field, is told in `otwarp.optics.table`, whose
`ForceTable.force` is the float64 twin of what is here.
"""

import warp as wp

from otwarp.kernels.roots import reciprocal_root, square_root


@wp.struct
class ForceTableData:
    """All tables of a scene, one after another; L levels in all, of every table from the finest outward.

    Nodes are forces per mW [pN]; those of one (z, ρ) lie together, layer by layer.
    """

    node: wp.array(dtype=wp.vec3)
    level_start: wp.array(dtype=wp.int32)  # (tables + 1) first level of each table
    node_start: wp.array(dtype=wp.int32)  # (L) first node
    columns: wp.array(dtype=wp.int32)  # (L) nodes along ρ
    radius: wp.array(dtype=wp.float32)  # (L) distance from the focus up to which the level serves [µm]
    per_spacing: wp.array(dtype=wp.float32)  # (L) 1/spacing [1/µm]


@wp.struct
class GridLevel:
    """One level, as interpolation needs it; a loop of steps keeps the finest in registers."""

    node: wp.int32  # first node
    columns: wp.int32
    radius: wp.float32  # [µm]
    per_spacing: wp.float32  # [1/µm]
    middle: wp.float32  # cells below the focus


@wp.func
def grid_level(tables: ForceTableData, level: int) -> GridLevel:
    """Level of this number, counted over all tables."""
    radius = tables.radius[level]
    per_spacing = tables.per_spacing[level]
    return GridLevel(tables.node_start[level], tables.columns[level], radius, per_spacing, radius * per_spacing)


BLEND = wp.constant(0.8)
"""As `otwarp.optics.table.BLEND`."""

BLEND_SCALE = wp.constant(1.0 / (1.0 - 0.8 * 0.8))


@wp.func
def blend_weight(d2: float, radius: float) -> float:
    """Share of what lies beyond `radius`: a smooth step in distance² from `BLEND`·radius to radius."""
    x = wp.clamp((d2 / (radius * radius) - BLEND * BLEND) * BLEND_SCALE, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


ROUNDER = 12582912.0
"""1.5·2²³: adding it to a number below 2²² leaves the nearest integer in the low bits."""

_FLOOR = """
#if defined(__CUDA_ARCH__)
    return {cuda};
#else
    return {cpu};
#endif
"""


@wp.func_native(_FLOOR.format(cuda=f"__float_as_int(u - 0.5f + {ROUNDER}f) - 0x4B400000", cpu="(int)u"))
def cell_of(u: wp.float32) -> wp.int32:
    """Cell of a grid coordinate 0 ≤ u < 2²²; at a node either neighbour. Conversions are slow on CUDA, sums are not."""
    ...


@wp.func_native(_FLOOR.format(cuda=f"(u - 0.5f + {ROUNDER}f) - {ROUNDER}f", cpu="(float)(int)u"))
def cell_start(u: wp.float32) -> wp.float32:
    """The same cell as a number."""
    ...


@wp.func_native("""
    return nodes.data[n];
""")
def node_at(nodes: wp.array(dtype=wp.vec3), n: int) -> wp.vec3:
    """Node n, without the strides and negative indices of Warp's indexing, so that neighbours share an address."""
    ...


@wp.func
def one_layer(tables: ForceTableData, node: int, first: wp.vec3, second: wp.vec3) -> wp.vec3:
    """F_ρ, F_φ, F_z of a node in a beam of one helicity."""
    return node_at(tables.node, node)


@wp.func
def two_layers(tables: ForceTableData, node: int, first: wp.vec3, second: wp.vec3) -> wp.vec3:
    """Those of a polarized beam; `first` = (cos 2φ, sin 2φ, cos 2φ)."""
    return node_at(tables.node, 2 * node) + wp.cw_mul(first, node_at(tables.node, 2 * node + 1))


@wp.func
def three_layers(tables: ForceTableData, node: int, first: wp.vec3, second: wp.vec3) -> wp.vec3:
    """Those of a polarized vortex; `second` = (sin 2φ, cos 2φ, sin 2φ)."""
    polarized = wp.cw_mul(first, node_at(tables.node, 3 * node + 1)) + wp.cw_mul(
        second, node_at(tables.node, 3 * node + 2)
    )
    return node_at(tables.node, 3 * node) + polarized


NODE_TERMS = {1: one_layer, 2: two_layers, 3: three_layers}


def bilinear_term(layers: int) -> wp.Function:
    """`(tables, level, rho, z, first, second) -> (F_ρ, F_φ, F_z)` by linear interpolation along both axes."""
    at = NODE_TERMS[layers]

    @wp.func
    def bilinear(
        tables: ForceTableData, level: GridLevel, rho: float, z: float, first: wp.vec3, second: wp.vec3
    ) -> wp.vec3:
        """Four nodes."""
        u = rho * level.per_spacing
        v = z * level.per_spacing + level.middle
        i = cell_of(u)
        j = cell_of(v)
        a = u - cell_start(u)
        b = v - cell_start(v)
        n = level.node + (j + 1) * level.columns + i + 1
        both = a * b
        total = (1.0 - a - (b - both)) * at(tables, n, first, second)
        total += (a - both) * at(tables, n + 1, first, second)
        n += level.columns
        total += (b - both) * at(tables, n, first, second)
        return total + both * at(tables, n + 1, first, second)

    return bilinear


@wp.func
def cubic_weights(t: float) -> wp.vec4:
    """Uniform cubic B-spline at offset t in a cell, for nodes −1, 0, 1, 2."""
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
        """Sixteen nodes."""
        u = rho * level.per_spacing
        v = z * level.per_spacing + level.middle
        i = cell_of(u)
        j = cell_of(v)
        wu = cubic_weights(u - cell_start(u))
        wv = cubic_weights(v - cell_start(v))
        n = level.node + j * level.columns + i
        total = wp.vec3(0.0)
        for k in range(4):
            row = wu[0] * at(tables, n, first, second)
            row += wu[1] * at(tables, n + 1, first, second)
            row += wu[2] * at(tables, n + 2, first, second)
            row += wu[3] * at(tables, n + 3, first, second)
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
    def far_force(
        tables: ForceTableData, table: int, rho: float, z: float, d2: float, first: wp.vec3, second: wp.vec3
    ) -> wp.vec3:
        """Beyond the inner part of the finest level: the level that serves, blended with the one outside it."""
        level = tables.level_start[table]
        last = tables.level_start[table + 1] - 1
        while level < last and d2 >= tables.radius[level] * tables.radius[level]:
            level += 1
        radius = tables.radius[level]
        force = wp.vec3(0.0)
        # written so that a NaN is outside
        if d2 < radius * radius:
            w = blend_weight(d2, radius)
            force = (1.0 - w) * interpolate(tables, grid_level(tables, level), rho, z, first, second)
            if level < last and w > 0.0:
                force += w * interpolate(tables, grid_level(tables, level + 1), rho, z, first, second)
        return force

    @wp.func
    def table_force(tables: ForceTableData, table: int, finest: GridLevel, x: float, y: float, z: float) -> wp.vec3:
        """Cylindrical components at the sphere's place, turned into Cartesian ones."""
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
            f = far_force(tables, table, rho, z, d2, first, second)
        return wp.vec3(f[0] * c - f[1] * s, f[0] * s + f[1] * c, f[2])

    return table_force
