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


@wp.kernel(enable_backward=False)
def fill_cells(
    start: wp.array(dtype=wp.vec3),
    end: wp.array(dtype=wp.vec3),
    radius: wp.array(dtype=float),
    corner: wp.vec3,
    size: wp.vec3,
    filled: wp.array3d(dtype=float),
):
    """Share of each cell that solids fill, 0 to 1, for cells (slice, y, x) of `size` [µm] from `corner` on.

    A cell that the surface passes is filled as a half-space would fill it whose face is the surface's tangent, to first
    order in the distance: the ramp is as wide as the cell is along the normal.
    """
    k, j, i = wp.tid()
    p = corner + wp.vec3((float(i) + 0.5) * size[0], (float(j) + 0.5) * size[1], (float(k) + 0.5) * size[2])
    nearest = float(1.0e30)
    share = float(0.0)
    for n in range(radius.shape[0]):
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
    filled[k, j, i] = share
