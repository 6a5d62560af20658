"""How much of each cell of a slice is filled by solids, with soft edges."""

from __future__ import annotations

import warp as wp


@wp.func
def distance_outside(p: wp.vec3, start: wp.vec3, end: wp.vec3, radius: float) -> float:
    """Signed distance of a point from a capsule, negative inside [µm]; a sphere where both ends are one point."""
    along = end - start
    square = wp.dot(along, along)
    t = float(0.0)
    if square > 0.0:
        t = wp.clamp(wp.dot(p - start, along) / square, 0.0, 1.0)
    return wp.length(p - start - t * along) - radius


@wp.func
def share_of_cell(
    p: wp.vec3,
    size: wp.vec3,
    start: wp.array(dtype=wp.vec3),
    end: wp.array(dtype=wp.vec3),
    radius: wp.array(dtype=float),
    first: int,
    last: int,
) -> float:
    """Share of a cell of `size` around p that solids `first` to `last` − 1 fill, 0 to 1 [µm].

    A cell that the surface passes is filled as a half-space would fill it whose face is the surface's tangent, to first
    order in the distance: the ramp is as wide as the cell is along the normal.
    """
    nearest = float(1.0e30)
    share = float(0.0)
    for n in range(first, last):
        d = distance_outside(p, start[n], end[n], radius[n])
        if d < nearest:
            nearest = d
            # the normal is the direction from the axis
            along = end[n] - start[n]
            square = wp.dot(along, along)
            t = float(0.0)
            if square > 0.0:
                t = wp.clamp(wp.dot(p - start[n], along) / square, 0.0, 1.0)
            normal = wp.normalize(p - start[n] - t * along)
            width = wp.length(wp.cw_mul(normal, size))
            share = wp.clamp(0.5 - d / wp.max(width, 1.0e-9), 0.0, 1.0)
    return share


@wp.kernel(enable_backward=False)
def fill_cells(
    start: wp.array(dtype=wp.vec3),
    end: wp.array(dtype=wp.vec3),
    radius: wp.array(dtype=float),
    corner: wp.vec3,
    size: wp.vec3,
    filled: wp.array3d(dtype=float),
):
    """`share_of_cell` of all solids, for cells (slice, y, x) of `size` [µm] from `corner` on."""
    k, j, i = wp.tid()
    p = corner + wp.vec3((float(i) + 0.5) * size[0], (float(j) + 0.5) * size[1], (float(k) + 0.5) * size[2])
    filled[k, j, i] = share_of_cell(p, size, start, end, radius, 0, radius.shape[0])


@wp.kernel(enable_backward=False)
def fill_slices(
    start: wp.array(dtype=wp.vec3),
    end: wp.array(dtype=wp.vec3),
    radius: wp.array(dtype=float),
    first: wp.array(dtype=int),
    corner: wp.vec2,
    spacing: float,
    low: wp.array(dtype=float),
    thickness: wp.array(dtype=float),
    layers: wp.array(dtype=int),
    filled: wp.array4d(dtype=float),
):
    """The same of many specimens, for (specimen, slice, y, x): 0 beyond the slices of each.

    Solids of specimen n are those from first[n] to first[n + 1] − 1; its slices begin at the height low[n] [µm].
    """
    n, k, j, i = wp.tid()
    h = thickness[n]
    p = wp.vec3(
        corner[0] + (float(i) + 0.5) * spacing, corner[1] + (float(j) + 0.5) * spacing, low[n] + (float(k) + 0.5) * h
    )
    share = float(0.0)
    if k < layers[n]:
        share = share_of_cell(p, wp.vec3(spacing, spacing, h), start, end, radius, first[n], first[n + 1])
    filled[n, k, j, i] = share
