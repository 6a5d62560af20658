"""How force tables lie in memory, for all that interpolates in them; `otwarp.optics.table` says what they mean."""

import warp as wp

from otwarp.laws.table import BLEND


@wp.struct
class GridLevel:
    """One level, as interpolation needs it; a loop of steps keeps the finest in registers."""

    node: wp.int32  # first node
    columns: wp.int32  # nodes along ρ
    radius: wp.float32  # distance from the focus up to which the level serves [µm]
    per_spacing: wp.float32  # 1/spacing [1/µm]
    middle: wp.float32  # cells below the focus


@wp.struct
class ForceTableData:
    """All tables of a scene, one after another; L levels in all, of every table from the finest outward.

    Nodes are forces per mW [pN]; those of one (z, ρ) lie together, layer by layer. Each has a fourth number, 0, because
    a GPU reads four at once.
    """

    node: wp.array(dtype=wp.vec4)
    level_start: wp.array(dtype=wp.int32)  # (tables + 1) first level of each table
    level: wp.array(dtype=GridLevel)  # (L)


BLEND_SCALE = wp.constant(1.0 / (1.0 - BLEND * BLEND))
"""What makes the blend run from 0 to 1 in squared distance over squared radius."""
