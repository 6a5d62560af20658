"""Neighbour lists with a skin (Verlet 1967, doi:10.1103/PhysRev.159.98), made from cells sorted by radix.

A list holds every element nearer than the sum of the radii, the reach of contact forces and the skin, so it serves
until something has moved by more than half the skin; then the device makes new lists by itself. Cells repeat along each
axis: along a periodic one with the period, along an open one distances tell apart what shares a cell by that. A list
ascends by sphere, so that sums over it do not depend on when it was made. An element with more than `NEIGHBOURS`
neighbours (a large sphere among small ones) is `FULL`: it looks through the cells in every step.
"""

import warp as wp

from otwarp.kernels.contact.obstacles import distance_term, still_pose
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.types import ModelData, StateData
from otwarp.kernels.drivers.grid_data import GridData, NeighbourData, body_pose_term

NEIGHBOURS = 24
"""Neighbours that a list can hold."""

FULL = wp.constant(-1)
"""Count of a list that could not hold all neighbours."""

_FARTHEST_CELL = wp.constant(1.0e9)
_NO_SPHERE = wp.constant(2147483647)


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
            centre = centre + wp.quat_rotate(pose.rotation, wp.vec3(s[0], s[1], s[2]))
        return wp.vec4(centre[0], centre[1], centre[2], s[3])

    return slot_element if f.soft_contacts else sphere_element


def name_term(f: Features) -> wp.Function:
    """`(grid, i) -> int`: a number that an element keeps when slots are sorted anew; lists ascend by it."""

    @wp.func
    def slot_name(grid: GridData, i: int) -> int:
        """Index of the body in slot i."""
        return grid.order[grid.turn[0], i]

    @wp.func
    def sphere_name(grid: GridData, i: int) -> int:
        """Index of the sphere itself: spheres are not sorted anew."""
        return i

    return slot_name if f.soft_contacts else sphere_name


def apart_term(f: Features) -> wp.Function:
    """`(model, grid, world, i, j) -> bool`: whether two elements of a world belong to two bodies."""

    @wp.func
    def other_slot(model: ModelData, grid: GridData, world: int, i: int, j: int) -> bool:
        """Whether i and j are two slots: each slot is a body."""
        return i != j

    @wp.func
    def other_body(model: ModelData, grid: GridData, world: int, i: int, j: int) -> bool:
        """Whether spheres i and j belong to different bodies."""
        first = world * grid.near.elements
        return model.contact.body[i - first] != model.contact.body[j - first]

    return other_slot if f.soft_contacts else other_body


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


def cell_item_term(f: Features) -> wp.Function:
    """`(n, s) -> int`: element of sorted entry s; slots are sorted themselves."""

    @wp.func
    def slot_item(n: NeighbourData, s: int) -> int:
        """The entry itself: slots are sorted in place."""
        return s

    @wp.func
    def sphere_item(n: NeighbourData, s: int) -> int:
        """Index of the sphere of sorted entry s."""
        return n.item[s]

    return slot_item if f.soft_contacts else sphere_item


def walled_term(f: Features) -> wp.Function:
    """`(model, grid, centre, radius) -> int`: 1 if an obstacle may be touched before the next lists are made."""
    distance_to = distance_term(f.obstacles)

    @wp.func
    def walled(model: ModelData, grid: GridData, centre: wp.vec3, radius: float) -> int:
        """1 where an obstacle at rest is within reach plus skin, or any obstacle moves; else 0."""
        near = int(wp.static(f.moving_obstacles))
        if wp.static(not f.moving_obstacles):
            far = radius + grid.near.reach + grid.near.skin
            for o in range(model.obstacles.shape.shape[0]):
                wall = still_pose(model.obstacles, o, wp.float64(0.0))
                away = centre - wall.position
                if wp.static(f.periodic):
                    away = nearest(model.period, away)
                if wp.length(away) < far + model.obstacles.bound[o]:
                    local = wp.quat_rotate_inv(wall.rotation, away)
                    if distance_to(model.obstacles, o, local, far)[3] < far:
                        near = 1
        return near

    return walled


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


def insert_term(f: Features) -> wp.Function:
    """`(grid, base, found, j)`: insert element j into the first `found` entries of the list that begins at `base`."""
    name = name_term(f)

    @wp.func
    def insert(grid: GridData, base: int, found: int, j: int):
        """Insert by ascending name; the list must have room for one more."""
        n = grid.near
        own = name(grid, j)
        k = found
        while k > 0 and name(grid, n.neighbour[base + wp.max(k - 1, 0) * n.pitch]) > own:
            n.neighbour[base + k * n.pitch] = n.neighbour[base + (k - 1) * n.pitch]
            k -= 1
        n.neighbour[base + k * n.pitch] = j

    return insert


def search_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i, centre, far, run, found) -> found`: list neighbours of i in a run of entries."""
    element, apart, item, insert = element_term(f), apart_term(f), cell_item_term(f), insert_term(f)

    @wp.func
    def search(
        model: ModelData, state: StateData, grid: GridData, world: int, i: int, centre: wp.vec3, far: float,
        run: wp.vec2i, found: int,
    ) -> int:  # fmt: skip
        """Number of neighbours after the sorted entries of `run`; it may exceed the room of the list."""
        n = grid.near
        for s in range(run[0], run[1]):
            j = item(n, s)
            e = element(model, state, grid, world, j)
            reach = far + e[3]
            away = centre - wp.vec3(e[0], e[1], e[2])
            if wp.static(f.periodic):
                away = nearest(model.period, away)
            if wp.length_sq(away) < reach * reach and e[3] > 0.0:
                if apart(model, grid, world, i, j):
                    if found < wp.static(NEIGHBOURS):
                        insert(grid, i * n.stride, found, j)
                    found += 1
        return found

    return search


def make_list(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its elements): the neighbours of each, ascending; whether obstacles are near."""
    element, search = element_term(f), search_term(f)
    walled = walled_term(f) if f.obstacles else None

    @wp.func
    def list_one(model: ModelData, state: StateData, grid: GridData, world: int, i: int):
        """Write reference place, neighbours and obstacle mark of element i."""
        n = grid.near
        e = element(model, state, grid, world, i)
        centre = wp.vec3(e[0], e[1], e[2])
        n.reference[i] = centre
        found = int(0)
        if wp.static(f.pairs):
            if e[3] > 0.0:
                far = e[3] + n.reach + n.skin
                c = cell_of(n, centre)
                inside = (c[2] & (n.cells[2] - 1)) > 0 and ((c[2] + 1) & (n.cells[2] - 1)) > 0
                for column in range(9):
                    key = cell_key(n, world, c[0] - 1 + column // 3, c[1] - 1 + column % 3, c[2] - 1)
                    if inside:
                        found = search(model, state, grid, world, i, centre, far, run_of_three(n, key), found)
                    else:
                        for z in range(3):
                            key = cell_key(n, world, c[0] - 1 + column // 3, c[1] - 1 + column % 3, c[2] - 1 + z)
                            one = wp.vec2i(n.start[key], n.finish[key])
                            found = search(model, state, grid, world, i, centre, far, one, found)
                if found > wp.static(NEIGHBOURS):
                    found = FULL
        n.count[i] = found
        if wp.static(bool(f.obstacles)):
            near = int(0)
            if e[3] > 0.0:
                near = walled(model, grid, centre, e[3])
            n.walled[i] = near

    @wp.kernel(module="unique", enable_backward=False)
    def list_neighbours(model: ModelData, state: StateData, grid: GridData, size: int):
        """Lists of the `size` elements of one share of a world; counts how often lists were made."""
        world, share = wp.tid()
        first = world * grid.near.elements
        for i in range(first + share * size, first + wp.min((share + 1) * size, grid.near.elements)):
            list_one(model, state, grid, world, i)
        if world == 0 and share == 0:
            grid.near.stale[0] = 0
            grid.near.builds[0] = grid.near.builds[0] + 1

    return list_neighbours


def next_in_cells_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i, last) -> j`: for a FULL element the next one it touches; -1 at the end.

    Start with `last` = -1. The cells are those of the last lists; nothing has left their surroundings since.
    """
    element, name, apart, item = element_term(f), name_term(f), apart_term(f), cell_item_term(f)

    @wp.func
    def next_in_cells(model: ModelData, state: StateData, grid: GridData, world: int, i: int, last: int) -> int:
        """Touching element of the smallest name above that of `last`, by a search of the 27 cells around."""
        n = grid.near
        own = element(model, state, grid, world, i)
        here = wp.vec3(own[0], own[1], own[2])
        after = int(-1)
        if last >= 0:
            after = name(grid, last)
        best = int(-1)
        least = int(_NO_SPHERE)
        c = cell_of(n, n.reference[i])
        for cell in range(27):
            key = cell_key(n, world, c[0] - 1 + cell // 9, c[1] - 1 + (cell // 3) % 3, c[2] - 1 + cell % 3)
            for s in range(n.start[key], n.finish[key]):
                j = item(n, s)
                called = name(grid, j)
                if called > after and called < least and apart(model, grid, world, i, j):
                    e = element(model, state, grid, world, j)
                    away = here - wp.vec3(e[0], e[1], e[2])
                    if wp.static(f.periodic):
                        away = nearest(model.period, away)
                    gap = wp.length(away) - own[3] - e[3]
                    if gap < n.reach and e[3] > 0.0:
                        best = j
                        least = called
        return best

    return next_in_cells


@wp.func
def check_moved(n: NeighbourData, away: wp.vec3):
    """Mark all lists as stale when an element is `away` [µm] from where they were made by more than half the skin."""
    if 4.0 * wp.length_sq(away) > n.skin * n.skin:
        n.stale[0] = 1


def make_check(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its elements): ask for new lists if the state was changed from outside."""
    element = element_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def check(model: ModelData, state: StateData, grid: GridData, size: int):
        """Mark all lists as stale if one of the `size` elements of a share has moved by more than half the skin."""
        world, share = wp.tid()
        first = world * grid.near.elements
        for i in range(first + share * size, first + wp.min((share + 1) * size, grid.near.elements)):
            e = element(model, state, grid, world, i)
            away = wp.vec3(e[0], e[1], e[2]) - grid.near.reference[i]
            if wp.static(f.periodic):
                away = nearest(model.period, away)
            check_moved(grid.near, away)

    return check
