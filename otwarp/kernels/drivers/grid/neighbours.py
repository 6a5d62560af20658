"""Neighbour lists with a skin (Verlet 1967, doi:10.1103/PhysRev.159.98), made from cells sorted by radix.

A list holds every element nearer than the sum of the radii, the reach of contact forces and the skin, so it serves
until something has moved by more than half the skin; then the device makes new lists by itself. A list ascends by
sphere, so that sums over it do not depend on when it was made. An element with more than `NEIGHBOURS` neighbours (a
large sphere among small ones) is `FULL`: it looks through the cells in every step. A world that a block of threads has
to itself needs no cells: all pairs of its spheres are tested.
"""

import warp as wp

from otwarp.kernels.contact.obstacles import distance_term, still_pose
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import beside, distance_of, point_of, radius_of
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.types import ModelData, StateData
from otwarp.kernels.cpu.pair_block import among_term
from otwarp.kernels.drivers.grid.cells import cell_key, cell_of, element_term, run_of_three
from otwarp.kernels.drivers.grid.data import GridData, NeighbourData, in_columns, own_term

NEIGHBOURS = 24
"""Neighbours that a list can hold."""

FULL = wp.constant(-1)
"""Count of a list that could not hold all neighbours."""

_NO_SPHERE = wp.constant(2147483647)


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


def entry_term(f: Features) -> wp.Function:
    """`(n, s) -> int`: element of entry s, sorted by cell or, of a world by itself, as they come; slots are sorted."""

    @wp.func
    def own_item(n: NeighbourData, s: int) -> int:
        """Entries that are not sorted are elements: s itself."""
        return s

    @wp.func
    def sphere_item(n: NeighbourData, s: int) -> int:
        """Index of the sphere of sorted entry s."""
        return n.item[s]

    return own_item if f.soft_contacts or f.by_world else sphere_item


@wp.func
def obstacle_bit(o: int) -> int:
    """What obstacle o is in a mark of those that are near; of more than 32 several share a bit."""
    return 1 << (o & 31)


def walled_term(f: Features) -> wp.Function:
    """`(model, grid, centre, radius) -> int`: which obstacles may be touched before the next lists are made."""
    distance_to = distance_term(f.obstacles)

    @wp.func
    def walled(model: ModelData, grid: GridData, centre: wp.vec3, radius: float) -> int:
        """Not 0 where an obstacle at rest is within reach plus skin, or any obstacle moves: a bit for each, in turn."""
        near = int(wp.static(-int(f.moving_obstacles)))
        if wp.static(not f.moving_obstacles):
            far = radius + grid.near.reach + grid.near.skin
            for o in range(model.obstacles.shape.shape[0]):
                wall = still_pose(model.obstacles, o, wp.float64(0.0))
                away = centre - wall.position
                if wp.static(f.periodic):
                    away = nearest(model.period, away)
                if wp.length(away) < far + model.obstacles.bound[o]:
                    local = wp.quat_rotate_inv(wall.rotation, away)
                    if distance_of(distance_to(model.obstacles, o, local, far)) < far:
                        near = near | obstacle_bit(o)
        return near

    return walled


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
    element = reference_term(f) if f.by_world else element_term(f)
    apart, item, insert = apart_term(f), entry_term(f), insert_term(f)

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
            reach = far + radius_of(e)
            away = centre - point_of(e)
            if wp.static(f.periodic):
                away = nearest(model.period, away)
            if wp.length_sq(away) < reach * reach and radius_of(e) > 0.0:
                if apart(model, grid, world, i, j):
                    if found < wp.static(NEIGHBOURS):
                        insert(grid, i * n.stride, found, j)
                    found += 1
        return found

    return search


def reference_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i) -> vec4(centre, radius)` of element i where the lists were made."""

    @wp.func
    def referred(model: ModelData, state: StateData, grid: GridData, world: int, i: int) -> wp.vec4:
        """Centre [µm] and radius [µm] of sphere i, as `refer` wrote it."""
        p = grid.near.reference[i]
        return beside(p, radius_of(model.contact.sphere[i - world * grid.near.elements]))

    return referred


def around_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i, e) -> int`: list the neighbours of element i, vec4 e; how many there are."""
    search = search_term(f)
    among = among_term(f.periodic) if in_columns(f) else None

    @wp.func
    def of_columns(model: ModelData, state: StateData, grid: GridData, world: int, i: int, e: wp.vec4) -> int:
        """The same in vector registers: `NEIGHBOURS` at most are listed."""
        n = grid.near
        first = world * n.elements
        b = model.contact.body[i - first]
        return among(
            model.period, grid.sorted, first, first + n.elements, first + model.contact.start[b],
            first + model.contact.start[b + 1], point_of(e), radius_of(e) + n.reach + n.skin, n.neighbour,
            i * n.stride, NEIGHBOURS,
        )  # fmt: skip

    @wp.func
    def of_all(model: ModelData, state: StateData, grid: GridData, world: int, i: int, e: wp.vec4) -> int:
        """Among all elements of the world."""
        n = grid.near
        first = world * n.elements
        far = radius_of(e) + n.reach + n.skin
        all = wp.vec2i(first, first + n.elements)
        return search(model, state, grid, world, i, point_of(e), far, all, 0)

    @wp.func
    def in_cells(model: ModelData, state: StateData, grid: GridData, world: int, i: int, e: wp.vec4) -> int:
        """Among those in the cells around."""
        n = grid.near
        centre = point_of(e)
        found = int(0)
        far = radius_of(e) + n.reach + n.skin
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
        return found

    if in_columns(f):
        return of_columns
    return of_all if f.by_world else in_cells


def refer_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i) -> vec4(centre, radius)`: note where element i is when lists are made."""
    element = element_term(f)

    @wp.func
    def refer(model: ModelData, state: StateData, grid: GridData, world: int, i: int) -> wp.vec4:
        """Write the reference place [µm] of element i, and give it back with its radius [µm]."""
        e = element(model, state, grid, world, i)
        grid.near.reference[i] = point_of(e)
        if wp.static(in_columns(f)):
            for c in range(4):
                grid.sorted[c, i] = e[c]
        return e

    return refer


def list_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i, e)`: neighbours of element i, vec4 e, ascending; whether obstacles are near."""
    around = around_term(f) if f.pairs else None
    walled = walled_term(f) if f.obstacles else None

    @wp.func
    def list_one(model: ModelData, state: StateData, grid: GridData, world: int, i: int, e: wp.vec4):
        """Write neighbours and obstacle mark of element i."""
        n = grid.near
        found = int(0)
        if wp.static(f.pairs):
            if radius_of(e) > 0.0:
                found = around(model, state, grid, world, i, e)
                if found > wp.static(NEIGHBOURS):
                    found = FULL
        n.count[i] = found
        if wp.static(bool(f.obstacles)):
            near = int(0)
            if radius_of(e) > 0.0:
                near = walled(model, grid, point_of(e), radius_of(e))
            n.walled[i] = near

    return list_one


@wp.func
def lists_made(n: NeighbourData, own: int):
    """Note that the lists of a world, or of all, are new."""
    n.stale[own] = 0
    n.builds[own] = n.builds[own] + 1


def make_list(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its elements): the neighbours of each, ascending; whether obstacles are near."""
    refer, list_one = refer_term(f), list_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def list_neighbours(model: ModelData, state: StateData, grid: GridData, size: int):
        """Lists of the `size` elements of one share of a world; counts how often lists were made."""
        world, share = wp.tid()
        first = world * grid.near.elements
        for i in range(first + share * size, first + wp.min((share + 1) * size, grid.near.elements)):
            list_one(model, state, grid, world, i, refer(model, state, grid, world, i))
        if world == 0 and share == 0:
            lists_made(grid.near, 0)

    return list_neighbours


def next_in_cells_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i, last) -> j`: for a FULL element the next one it touches; -1 at the end.

    Start with `last` = -1. The cells are those of the last lists; nothing has left their surroundings since.
    """
    element, name, apart, item = element_term(f), name_term(f), apart_term(f), entry_term(f)

    @wp.func
    def next_in_run(
        model: ModelData, state: StateData, grid: GridData, world: int, i: int, own: wp.vec4, last: int, run: wp.vec2i,
        best: int,
    ) -> int:  # fmt: skip
        """Touching element of the smallest name above that of `last`, of `best` and the entries of a run; -1: none."""
        n = grid.near
        here = point_of(own)
        after = int(-1)
        if last >= 0:
            after = name(grid, last)
        least = int(_NO_SPHERE)
        if best >= 0:
            least = name(grid, best)
        for s in range(run[0], run[1]):
            j = item(n, s)
            called = name(grid, j)
            if called > after and called < least and apart(model, grid, world, i, j):
                e = element(model, state, grid, world, j)
                away = here - point_of(e)
                if wp.static(f.periodic):
                    away = nearest(model.period, away)
                gap = wp.length(away) - radius_of(own) - radius_of(e)
                if gap < n.reach and radius_of(e) > 0.0:
                    best = j
                    least = called
        return best

    @wp.func
    def next_of_all(model: ModelData, state: StateData, grid: GridData, world: int, i: int, last: int) -> int:
        """Element that i touches, of the smallest name above that of `last`, among all of its world; -1: none."""
        own = element(model, state, grid, world, i)
        first = world * grid.near.elements
        all = wp.vec2i(first, first + grid.near.elements)
        return next_in_run(model, state, grid, world, i, own, last, all, -1)

    @wp.func
    def next_in_cells(model: ModelData, state: StateData, grid: GridData, world: int, i: int, last: int) -> int:
        """Element that i touches, of the smallest name above that of `last`, in the 27 cells around it; -1: none."""
        n = grid.near
        own = element(model, state, grid, world, i)
        best = int(-1)
        c = cell_of(n, n.reference[i])
        for cell in range(27):
            key = cell_key(n, world, c[0] - 1 + cell // 9, c[1] - 1 + (cell // 3) % 3, c[2] - 1 + cell % 3)
            run = wp.vec2i(n.start[key], n.finish[key])
            best = next_in_run(model, state, grid, world, i, own, last, run, best)
        return best

    return next_of_all if f.by_world else next_in_cells


@wp.func
def check_moved(n: NeighbourData, own: int, away: wp.vec3):
    """Mark lists as stale when an element is `away` [µm] from where they were made by more than half the skin."""
    if 4.0 * wp.length_sq(away) > n.skin * n.skin:
        n.stale[own] = 1


def check_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i)`: ask for new lists if element i is not where the state was left."""
    element, own = element_term(f), own_term(f)

    @wp.func
    def check_one(model: ModelData, state: StateData, grid: GridData, world: int, i: int):
        """Mark lists as stale if element i has moved by more than half the skin."""
        e = element(model, state, grid, world, i)
        away = point_of(e) - grid.near.reference[i]
        if wp.static(f.periodic):
            away = nearest(model.period, away)
        check_moved(grid.near, own(world), away)

    return check_one


def make_check(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its elements): ask for new lists if the state was changed from outside."""
    check_one = check_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def check(model: ModelData, state: StateData, grid: GridData, size: int):
        """Mark all lists as stale if one of the `size` elements of a share has moved by more than half the skin."""
        world, share = wp.tid()
        first = world * grid.near.elements
        for i in range(first + share * size, first + wp.min((share + 1) * size, grid.near.elements)):
            check_one(model, state, grid, world, i)

    return check
