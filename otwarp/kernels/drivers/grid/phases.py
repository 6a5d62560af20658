"""Worlds of some hundred bodies in phases: a kernel for each part of a step, for many worlds on GPUs.

What `world` does by a block of threads for many steps is done here by one kernel after the other, for all worlds, as
`world_phases` does for few bodies: together these parts are more code than a multiprocessor keeps at hand, and blocks
that go through them by themselves wait for instructions most of the time. Parts that look at one body or element have a
thread for each; contacts are settled by a team of threads for each world, which waits for nobody else. The functions
are those of `world`, so that results are the same: on a CPU to the last bit, on a GPU to the rounding of its compiler,
which fuses other multiplications in each kernel. Each world has a clock and flags of its own, as there.
"""

from dataclasses import dataclass
from typing import Any

import warp as wp

from otwarp.kernels.core.features import WORLD_BLOCK, Features
from otwarp.kernels.core.packed import beside, radius_of
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData
from otwarp.kernels.core.worlds import start_term, world_term
from otwarp.kernels.drivers.grid.data import GridData, PushData
from otwarp.kernels.drivers.grid.entries import no_entries
from otwarp.kernels.drivers.grid.entry_search import look_around_term
from otwarp.kernels.drivers.grid.inlets import let_bodies_in_term
from otwarp.kernels.drivers.grid.move import correct_term, two_stages
from otwarp.kernels.drivers.grid.neighbours import check_term, list_term, lists_made, refer_term
from otwarp.kernels.drivers.grid.step import advance_term, commit_term
from otwarp.kernels.drivers.grid.teams import Lane, seat_of
from otwarp.kernels.drivers.grid.world import contact_terms
from otwarp.kernels.optics.trap_command import move_trap_term

BLOCK = 128
"""Threads of a block where each has a body or element."""

BLOCKS = 4
"""Such blocks that a multiprocessor is to hold: 128 registers a thread, in place of 255."""

TEAM_BLOCK = 256
"""Threads of a block of teams, or more where one has more: four blocks that keep barriers fit on a multiprocessor."""


@dataclass(frozen=True, kw_only=True)
class GridPhases:
    """The kernels of a step, in the order of their launches; None where there is nothing to do.

    Attributes:
        start: Begins a call: clocks, and whether the state was changed from outside. A thread per element.
        refer: Begins a step, and notes where elements are whose lists are to be made anew. A thread per element.
        list: Makes these lists. A thread per element.
        advance: Free moves of the first stage. A thread per body.
        find: Claims entries for contacts, and moves traps. A thread per element, or per trap if there are more.
        settle: Solves the entries of a world, in the first stage and again in the second. A team per world.
        correct: The second stage. A thread per body.
        commit: Takes the moves. A thread per body.
        let_in: Cells that have left come in again. A thread per world.
    """

    start: wp.Kernel
    refer: wp.Kernel
    list: wp.Kernel
    advance: wp.Kernel
    find: wp.Kernel
    settle: wp.Kernel
    correct: wp.Kernel | None
    commit: wp.Kernel
    let_in: wp.Kernel | None

    @property
    def all(self) -> list[wp.Kernel]:
        """Those that there are."""
        return [kernel for kernel in vars(self).values() if kernel is not None]


def make_grid_phases(f: Features) -> GridPhases:
    """Kernels of a step of worlds whose threads share out the entries."""
    return GridPhases(
        start=make_start(f),
        refer=make_refer(f),
        list=make_list(f),
        advance=make_advance(f),
        find=make_find(f),
        settle=make_settle(f),
        correct=make_correct(f) if two_stages(f) else None,
        commit=make_commit(f),
        let_in=make_let_in(f) if f.inlet else None,
    )


def kernel_of(f: Features, block: int = BLOCK, bounds: tuple[int, int] = (BLOCK, BLOCKS)) -> Any:
    """Decorator of a kernel launched in blocks of `block` threads.

    `bounds` are the most threads of a block, and how many blocks of so many a multiprocessor is to hold.
    """
    # Warp compiles a kernel for each size of its blocks: that of the module is the one that launches use
    options = {**f.module_options, "block_dim": block}
    how = {"grid_stride": False, "launch_bounds": bounds, "module_options": options}
    return wp.kernel(module="unique", enable_backward=False, **how)


def make_start(f: Features) -> wp.Kernel:
    """Kernel over (place of a world, element): begin a call."""
    check_one, world_at, start_of = check_term(f), world_term(f), start_term(f)

    @kernel_of(f)
    def start(model: ModelData, state: StateData, grid: GridData, first_step: wp.int64, last_step: wp.int64):
        """Set the clock to before `first_step`; the call ends at `last_step`. Lists may be those of another state."""
        place, e = wp.tid()
        world = world_at(model, place)
        if world < 0:
            return
        if e == 0:
            grid.clock[world] = start_of(model, world, first_step) - wp.int64(1)
            grid.until[world] = start_of(model, world, last_step)
        check_one(model, state, grid, world, world * grid.near.elements + e)

    return start


def make_refer(f: Features) -> wp.Kernel:
    """Kernel over (place of a world, element): begin a step, and note where elements are that want new lists."""
    refer, world_at = refer_term(f), world_term(f)

    @kernel_of(f)
    def note_places(model: ModelData, state: StateData, grid: GridData):
        """Turn the clock of the world; its entries are those of the last step no more."""
        place, e = wp.tid()
        world = world_at(model, place)
        if world < 0:
            return
        if e == 0:
            grid.clock[world] = grid.clock[world] + wp.int64(1)
            no_entries(grid, world)
        if grid.near.stale[world] != 0:
            refer(model, state, grid, world, world * grid.near.elements + e)

    return note_places


def make_list(f: Features) -> wp.Kernel:
    """Kernel over (place of a world, element): list who is near whom, where lists are to be made anew."""
    list_one, world_at = list_term(f), world_term(f)

    @kernel_of(f)
    def list_neighbours(model: ModelData, state: StateData, grid: GridData):
        """The neighbours of an element from the places that were noted."""
        place, e = wp.tid()
        world = world_at(model, place)
        if world < 0 or grid.near.stale[wp.max(world, 0)] == 0:
            return
        i = world * grid.near.elements + e
        list_one(model, state, grid, world, i, beside(grid.near.reference[i], radius_of(model.contact.sphere[e])))

    return list_neighbours


def make_advance(f: Features) -> wp.Kernel:
    """Kernel over (place of a world, body): its free move in this step."""
    advance_some, world_at = advance_term(f), world_term(f)

    @kernel_of(f)
    def advance(model: ModelData, control: ControlData, state: StateData, grid: GridData):
        """Move a body as if it touched nothing."""
        place, b = wp.tid()
        world = world_at(model, place)
        if world < 0:
            return
        if b == 0 and grid.near.stale[world] != 0:
            lists_made(grid.near, world)
        advance_some(model, control, state, grid, world, b, b + 1, 1)

    return advance


def make_find(f: Features) -> wp.Kernel:
    """Kernel over (place of a world, element or trap): what an element may touch; traps go where they were seen."""
    look_around, world_at = look_around_term(f), world_term(f)
    move_trap = move_trap_term(f) if f.speed_limits else None

    @kernel_of(f)
    def find(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        grid: GridData,
        push: PushData,
    ):
        """Claim entries for an element, and move a trap one step on."""
        place, n = wp.tid()
        world = world_at(model, place)
        if world < 0:
            return
        if wp.static(f.speed_limits):
            if n < model.traps.axis.shape[0]:
                move_trap(model, control, state, world, n, wp.float64(grid.clock[world]) * model.time_step)
        if n < grid.near.elements:
            look_around(model, state, readout, grid, push, world, n)

    return find


def make_settle(f: Features) -> wp.Kernel:
    """Kernel over (place of a world, lane of its team): solve its entries."""
    _, settle_world = contact_terms(f)
    world_at = world_term(f)

    @kernel_of(f, TEAM_BLOCK, (WORLD_BLOCK, 1))
    def settle(
        model: ModelData,
        state: StateData,
        readout: ReadoutData,
        grid: GridData,
        push: PushData,
        lanes: int,
        again: int,
    ):
        """Contact forces of a world, by `lanes` threads; `again` in the second stage."""
        place, lane = wp.tid()
        world = world_at(model, place)
        if world < 0:
            return
        settle_world(model, state, readout, grid, push, Lane(world, lane, lanes, seat_of(lanes)), again, 0)

    return settle


def make_correct(f: Features) -> wp.Kernel:
    """Kernel over (place of a world, body): the second stage of its free move."""
    correct_body, world_at = correct_term(f), world_term(f)

    @kernel_of(f)
    def correct(model: ModelData, control: ControlData, state: StateData, grid: GridData, push: PushData):
        """Look at a body from where contacts let it come to."""
        place, b = wp.tid()
        world = world_at(model, place)
        if world >= 0:
            correct_body(model, control, state, grid, push, world, b)

    return correct


def make_commit(f: Features) -> wp.Kernel:
    """Kernel over (place of a world, body): take its move."""
    commit_body, world_at = commit_term(f), world_term(f)

    @kernel_of(f)
    def commit(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        grid: GridData,
        push: PushData,
    ):
        """The new pose of a body, which has no entries then."""
        place, b = wp.tid()
        world = world_at(model, place)
        if world < 0:
            return
        commit_body(model, control, state, readout, grid, push, world, b)
        grid.count[world, b] = 0
        grid.entry.links[world, b] = 0

    return commit


def make_let_in(f: Features) -> wp.Kernel:
    """Kernel over places of worlds: let lost cells in."""
    let_bodies_in, world_at = let_bodies_in_term(f), world_term(f)

    @kernel_of(f)
    def let_in(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData):
        """Cells that have left a world come in again."""
        world = world_at(model, wp.tid())
        if world >= 0:
            if grid.outside[world] != 0:
                let_bodies_in(model, state, readout, grid, world)
                grid.outside[world] = 0

    return let_in
