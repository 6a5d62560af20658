"""Cells of the grid driver: elements sorted by the cell they are in, so that what is near is found at once.

Cells repeat along each axis: along a periodic one with the period, along an open one distances tell apart what shares
a cell by that.
"""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import beside, point_of, radius_of
from otwarp.kernels.core.types import ModelData, StateData
from otwarp.kernels.drivers.grid.data import GridData, NeighbourData, body_pose_term

_FARTHEST_CELL = wp.constant(1.0e9)


def element_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i) -> vec4(centre, radius)` of element i of all worlds, as it is now."""

    @wp.func
    def slot_element(model: ModelData, state: StateData, grid: GridData, world: int, i: int) -> wp.vec4:
        """Centre [µm] and contact radius [µm] of the sphere in slot i."""
        return grid.place[grid.row[0], i]

    body_pose = body_pose_term(f)

    @wp.func
    def sphere_element(model: ModelData, state: StateData, grid: GridData, world: int, i: int) -> wp.vec4:
        """Centre [µm] and radius [µm] of colliding sphere i, from the pose of its body."""
        e = i - world * grid.near.elements
        s = model.contact.sphere[e]
        pose = body_pose(state, world, model.contact.body[e])
        centre = pose.position
        if wp.static(f.rigid):
            centre = centre + wp.quat_rotate(pose.rotation, point_of(s))
        return beside(centre, radius_of(s))

    return slot_element if f.soft_contacts else sphere_element


@wp.func
def cell_of(n: NeighbourData, centre: wp.vec3) -> wp.vec3i:
    """Integer coordinates of the cell of a point [µm]."""
    c = wp.cw_div(centre, n.edge)
    return wp.vec3i(
        int(wp.clamp(wp.floor(c[0]), -_FARTHEST_CELL, _FARTHEST_CELL)),
        int(wp.clamp(wp.floor(c[1]), -_FARTHEST_CELL, _FARTHEST_CELL)),
        int(wp.clamp(wp.floor(c[2]), -_FARTHEST_CELL, _FARTHEST_CELL)),
    )


@wp.func
def cell_key(n: NeighbourData, world: int, x: int, y: int, z: int) -> int:
    """Number of cell (x, y, z) of a world; cells repeat along each axis."""
    nx, ny, nz = n.cells[0], n.cells[1], n.cells[2]
    return ((world * nx + (x & (nx - 1))) * ny + (y & (ny - 1))) * nz + (z & (nz - 1))


@wp.func
def run_of_three(n: NeighbourData, key: int) -> wp.vec2i:
    """Sorted entries of three cells that follow each other: empty ones, of start and finish 0, may be among them."""
    first = wp.vec2i(n.start[key], n.finish[key])
    second = wp.vec2i(n.start[key + 1], n.finish[key + 1])
    third = wp.vec2i(n.start[key + 2], n.finish[key + 2])
    start = third[0]
    if second[1] > second[0]:
        start = second[0]
    if first[1] > first[0]:
        start = first[0]
    return wp.vec2i(start, wp.max(first[1], wp.max(second[1], third[1])))


def make_bin(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its elements): the cell of each, as a key to sort by."""
    element = element_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def bin_elements(model: ModelData, state: StateData, grid: GridData, size: int):
        """Write cell key and index of the `size` elements of one share of a world."""
        world, share = wp.tid()
        n = grid.near
        first = world * n.elements
        for i in range(first + share * size, first + wp.min((share + 1) * size, n.elements)):
            e = element(model, state, grid, world, i)
            c = cell_of(n, wp.vec3(e[0], e[1], e[2]))
            n.key[i] = cell_key(n, world, c[0], c[1], c[2])
            n.item[i] = i

    return bin_elements


@wp.kernel(enable_backward=False)
def clear_cells(start: wp.array(dtype=wp.int32), finish: wp.array(dtype=wp.int32)):
    """Mark one cell as empty: start = finish = 0."""
    i = wp.tid()
    start[i] = 0
    finish[i] = 0


@wp.kernel(enable_backward=False)
def bound_cells(
    key: wp.array(dtype=wp.int32), count: int, start: wp.array(dtype=wp.int32), finish: wp.array(dtype=wp.int32)
):
    """Write where a cell begins or ends among the `count` sorted keys."""
    i = wp.tid()
    here = key[i]
    if i == 0 or key[wp.max(i - 1, 0)] != here:
        start[here] = i
    if i == count - 1 or key[i + 1] != here:
        finish[here] = i + 1


@wp.kernel(enable_backward=False)
def permute_slots(
    item: wp.array(dtype=wp.int32), row: wp.array(dtype=wp.int32), turn: wp.array(dtype=wp.int32),
    place: wp.array2d(dtype=wp.vec4), order: wp.array2d(dtype=wp.int32),
):  # fmt: skip
    """Copy one body's place and index into the slot that the sort gives it."""
    i = wp.tid()
    source = item[i]
    now, here = row[0], turn[0]
    place[1 - now, i] = place[now, source]
    order[1 - here, i] = order[here, source]


@wp.kernel(enable_backward=False)
def turn_slots(row: wp.array(dtype=wp.int32), turn: wp.array(dtype=wp.int32)):
    """Make the permuted slots the present ones."""
    row[0] = 1 - row[0]
    turn[0] = 1 - turn[0]
