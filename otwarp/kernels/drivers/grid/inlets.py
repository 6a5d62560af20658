"""Inlets in the grid driver: at the end of a step, one thread per world lets in what has left, body by body.

It is launched only where a body of any world is outside: a conditional part of the captured graph.
"""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import beside, point_of, radius_of
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.recycling import has_left
from otwarp.kernels.core.types import ModelData, ReadoutData, StateData
from otwarp.kernels.drivers.grid.data import GridData, own_term
from otwarp.kernels.drivers.inlets import count_entry_term, let_all_in_term, let_in_term


def other_slots_clear_term(f: Features) -> wp.Function:
    """`(model, world, b, there, grid) -> bool`: the same where spheres sit in slots, at their next places."""

    @wp.func
    def other_slots_clear(model: ModelData, world: int, b: int, there: wp.vec3, grid: GridData) -> bool:
        """Whether the sphere overlaps none in another slot of its world."""
        clear = bool(True)
        first = world * model.bodies
        for i in range(first, first + model.bodies):
            other = grid.place[1 - grid.row[0], i]
            if grid.order[grid.turn[0], i] != b and radius_of(other) > 0.0:
                away = there - point_of(other)
                if wp.static(f.periodic):
                    away = nearest(model.period, away)
                clear = wp.length(away) >= radius_of(other) + model.body.bound[b]
                if not clear:
                    break
        return clear

    return other_slots_clear


def make_let_in(f: Features) -> wp.Kernel:
    """Kernel over worlds of the grid driver, at the end of a step in which some body of any world is outside."""
    if f.soft_contacts:
        return _make_slots_in(f)
    let_in = let_bodies_in_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def let_in_world(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData):
        """Let the bodies of one world in."""
        let_in(model, state, readout, grid, wp.tid())

    return let_in_world


def let_bodies_in_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world)`: let the bodies of one world in; neighbours are then listed anew."""
    let_all_in, own = let_all_in_term(f), own_term(f)

    @wp.func
    def let_bodies_in(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int):
        """Let in what has left, at the end of the present step."""
        now = grid.clock[own(world)] + wp.int64(1)
        if let_all_in(model, state, readout, world, state.position[world], now) > 0:
            grid.near.stale[own(world)] = 1

    return let_bodies_in


def _make_slots_in(f: Features) -> wp.Kernel:
    """The same where spheres sit in slots."""
    let_in = let_in_term(f, other_slots_clear_term(f), GridData)
    count_entry = count_entry_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def let_slots_in(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData):
        """Let the spheres of one world in, by the index of the body and not of the slot."""
        world = wp.tid()
        next = 1 - grid.row[0]
        for b in range(model.bodies):
            i = grid.slot[world, b]
            here = grid.place[next, i]
            position = point_of(here)
            if has_left(model, b, position):
                place, entered = let_in(model, world, b, position, grid, grid.clock[0] + wp.int64(1))
                if entered:
                    grid.place[next, i] = beside(place, radius_of(here))
                    count_entry(state, readout, world, b)
                    grid.near.stale[0] = 1

    return let_slots_in
