"""Neighbour lists of the slots of a CPU: what `neighbours` lists, found 16 at a time and kept one after the other.

A list is a row of pairs (see `otwarp.kernels.cpu.pair_block`), and the lists of a world follow each other without gaps,
so that a step reads them through. Each pair is in one list, that of its first slot, in no order.
"""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import point_of, radius_of
from otwarp.kernels.core.types import ModelData, StateData
from otwarp.kernels.cpu.pair_block import PAIRS, near_term, sort_slots, touching_term
from otwarp.kernels.drivers.grid.cells import cell_of
from otwarp.kernels.drivers.grid.data import GridData
from otwarp.kernels.drivers.grid.neighbours import FULL, NEIGHBOURS, lists_made, walled_term


def list_slot_term(f: Features) -> wp.Function:
    """`(model, grid, world, i, at) -> int`: list the neighbours of slot i from `at` on; where the next list begins."""
    near = near_term(f.periodic)
    walled = walled_term(f) if f.obstacles else None

    @wp.func
    def neighbours_of(model: ModelData, grid: GridData, world: int, i: int, place: wp.vec4, at: int) -> int:
        """How many there are in later slots; of more than `NEIGHBOURS` the first are listed."""
        n = grid.near
        here = point_of(place)
        k = (i - world * n.elements) % PAIRS
        return near(
            model.period, grid.sorted, n.start, n.finish, n.edge, n.cells, world, cell_of(n, here), here,
            radius_of(place) + n.reach + n.skin, i, k, n.neighbour, at, NEIGHBOURS,
        )  # fmt: skip

    @wp.func
    def list_slot(model: ModelData, grid: GridData, world: int, i: int, at: int) -> int:
        """Write reference place, neighbours and obstacle mark of slot i."""
        n = grid.near
        place = grid.place[grid.row[0], i]
        centre = point_of(place)
        n.reference[i] = centre
        found = int(0)
        if wp.static(f.pairs):
            if radius_of(place) > 0.0:
                found = neighbours_of(model, grid, world, i, place, at)
            n.begin[i] = at
        if wp.static(bool(f.obstacles)):
            near_wall = int(0)
            if radius_of(place) > 0.0:
                near_wall = walled(model, grid, centre, radius_of(place))
            n.walled[i] = near_wall
        n.count[i] = found
        if found > NEIGHBOURS:
            n.count[i] = FULL
            n.full[world] = 1
        return at + wp.where(found > NEIGHBOURS, 0, found)

    return list_slot


@wp.kernel(module="unique", enable_backward=False)
def sort_by_cell(grid: GridData):
    """Sort the slots of one world by cell: those that are near in space are near in memory."""
    world = wp.tid()
    n = grid.near
    first = world * n.elements
    sort_slots(
        grid.place, grid.row[0], grid.order, grid.turn[0], first, first + n.elements, n.edge, n.cells, world, n.key,
        n.start, n.finish, grid.sorted,
    )  # fmt: skip


def make_slot_list(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its slots), of which there is one: the neighbours of each."""
    list_slot = list_slot_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def list_slots(model: ModelData, state: StateData, grid: GridData, size: int):
        """Lists of the `size` slots of a world; counts how often lists were made."""
        world, _share = wp.tid()
        first = world * grid.near.elements
        last = first + grid.near.elements
        at = first * NEIGHBOURS
        grid.near.full[world] = 0
        for i in range(first, last):
            at = list_slot(model, grid, world, i, at)
        if world == 0:
            lists_made(grid.near, 0)

    return list_slots


def touching_pairs_term(f: Features) -> wp.Function:
    """`(model, grid, first, count, chosen) -> int`: the pairs of the slots first … first + count − 1 that touch."""
    touching = touching_term(f.periodic)

    @wp.func
    def touching_pairs(
        model: ModelData, grid: GridData, first: int, count: int, chosen: wp.array(dtype=wp.int32)
    ) -> int:
        """How many; each pair once, its first slot among these."""
        n = grid.near
        found = int(0)
        for begin in range(first, first + count, PAIRS):
            last = wp.min(begin + PAIRS, first + count) - 1
            end = n.begin[last] + wp.max(n.count[last], 0)
            found = touching(
                model.period, grid.place, grid.row[0], begin, last + 1 - begin, n.neighbour, n.begin[begin], end,
                n.reach, grid.order, grid.turn[0], model.body.shape, model.contact.compliance, model.contact.adhesion,
                model.contact.adhesion_range, chosen, found,
            )  # fmt: skip
        return found

    return touching_pairs
