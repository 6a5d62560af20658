"""The grid driver for worlds of some hundred bodies: a block of threads has a world to itself for many steps.

What `grid` launches one kernel after the other, for all bodies of all worlds, the threads of a block do here to the
bodies of their world, each to every so many, and wait for each other in between. A world thereby sweeps over its
contacts as often as it needs and no more, makes new lists when its own bodies have gone far, and what it reads again
and again stays near its multiprocessor. Lists come from all pairs of a world: so few are tested faster than sorted. On
a CPU a block is one thread, and several of them share out the worlds.
"""

import warp as wp

from otwarp.kernels.core.features import WORLD_BLOCK, Features
from otwarp.kernels.core.packed import radius_of
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData
from otwarp.kernels.core.worlds import start_term, world_term
from otwarp.kernels.drivers.grid.data import GridData, PushData, shares_entries
from otwarp.kernels.drivers.grid.entries import no_entries
from otwarp.kernels.drivers.grid.entry_search import look_around_term
from otwarp.kernels.drivers.grid.entry_sweeps import report, settle_entries_term
from otwarp.kernels.drivers.grid.inlets import let_bodies_in_term
from otwarp.kernels.drivers.grid.lists import find_term
from otwarp.kernels.drivers.grid.move import correct_term, two_stages
from otwarp.kernels.drivers.grid.neighbours import check_term, list_term, lists_made, refer_term
from otwarp.kernels.drivers.grid.step import advance_term, commit_term
from otwarp.kernels.drivers.grid.teams import Lane, meet, seat_of
from otwarp.kernels.drivers.grid.turns import settle_term
from otwarp.kernels.drivers.world import keep_together
from otwarp.kernels.optics.trap_command import move_trap_term


def renew_lists_term(f: Features) -> wp.Function:
    """`(model, state, grid, me)`: make the lists of a world anew if something has gone too far."""
    refer, list_one = refer_term(f), list_term(f)

    @wp.func
    def renew_lists(model: ModelData, state: StateData, grid: GridData, me: Lane):
        """Note where all elements are, then list who is near whom."""
        first = me.world * grid.near.elements
        last = first + grid.near.elements
        if grid.near.stale[me.world] != 0:
            for i in range(first + me.lane, last, me.lanes):
                refer(model, state, grid, me.world, i)
            meet(me)
            for i in range(first + me.lane, last, me.lanes):
                p = grid.near.reference[i]
                radius = radius_of(model.contact.sphere[i - first])
                list_one(model, state, grid, me.world, i, wp.vec4(p[0], p[1], p[2], radius))
            if me.lane == 0:
                lists_made(grid.near, me.world)

    return renew_lists


def contact_terms(f: Features) -> tuple[wp.Function, wp.Function]:
    """`(model, state, readout, grid, push, me)` finds the contacts of a world in a step.

    And `(model, state, readout, grid, push, me, again, turns)` solves them for their forces: one after the other on a
    CPU where that is enough, else all at once, shared out.
    """
    if f.in_turn:
        return _turn_terms(f)
    look_around, settle_entries = look_around_term(f), settle_entries_term(f)

    @wp.func
    def find_entries(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, me: Lane
    ):
        """Element by element what may be met."""
        for e in range(me.lane, grid.near.elements, me.lanes):
            look_around(model, state, readout, grid, push, me.world, e)

    @wp.func
    def settle(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, me: Lane, again: int,
        turns: int,
    ):  # fmt: skip
        """Sweep over the entries where there are any."""
        if grid.entry.total[me.world] != 0:
            settle_entries(model, state, readout, grid, push, me, again)
        if grid.clock[me.world] + wp.int64(1) == grid.until[me.world]:
            for a in range(me.lane, model.bodies, me.lanes):
                report(model, readout, grid, me.world, a)

    return find_entries, settle


def _turn_terms(f: Features) -> tuple[wp.Function, wp.Function]:
    """The same by the one thread that there is, for contacts that take turns."""
    find_body, settle_world = find_term(f), settle_term(f)

    @wp.func
    def find_alone(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, me: Lane):
        """List the contacts of one body after the other."""
        for a in range(model.bodies):
            find_body(model, state, readout, grid, push, me.world, a)

    @wp.func
    def settle_alone(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, me: Lane, again: int,
        turns: int,
    ):  # fmt: skip
        """Round after round where any is to be solved."""
        if grid.touching[me.world] != 0:
            settle_world(model, readout, grid, push, me.world, again, turns)

    return find_alone, settle_alone


def stages_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, grid, push, me, turns)`: free moves and contact forces of a step."""
    advance_some = advance_term(f)
    correct_body = correct_term(f) if two_stages(f) else None
    find, settle = contact_terms(f) if f.contacts else (None, None)
    move_trap = move_trap_term(f) if f.speed_limits else None

    @wp.func
    def take_stages(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData,
        me: Lane, turns: int,
    ):  # fmt: skip
        """Both stages of the integrator with the contacts after each, in a loop: the code of the contacts is long."""
        for stage in range(int(wp.static(2 if two_stages(f) else 1))):
            if stage == 0:
                advance_some(model, control, state, grid, me.world, me.lane, model.bodies, me.lanes)
                keep_together()
                if wp.static(f.speed_limits):
                    time = wp.float64(grid.clock[me.world]) * model.time_step
                    for trap in range(me.lane, model.traps.axis.shape[0], me.lanes):
                        move_trap(model, control, state, me.world, trap, time)
                if wp.static(f.contacts):
                    find(model, state, readout, grid, push, me)
            elif wp.static(two_stages(f)):
                for b in range(me.lane, model.bodies, me.lanes):
                    correct_body(model, control, state, grid, push, me.world, b)
            keep_together()
            if wp.static(f.contacts):
                settle(model, state, readout, grid, push, me, stage, turns)

    return take_stages


def finish_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, grid, now, me)`: move the bodies of a world, and turn its clock."""
    commit_body = commit_term(f)
    let_bodies_in = let_bodies_in_term(f) if f.inlet else None

    @wp.func
    def finish(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData,
        me: Lane,
    ):  # fmt: skip
        """Commit the moves of all bodies, let lost cells in, and turn the clock to the next step [1]."""
        keep_together()
        for b in range(me.lane, model.bodies, me.lanes):
            commit_body(model, control, state, readout, grid, push, me.world, b)
            if wp.static(shares_entries(f)):
                grid.count[me.world, b] = 0
                grid.entry.links[me.world, b] = 0
        meet(me)
        if me.lane == 0:
            if wp.static(f.inlet):
                if grid.outside[me.world] != 0:
                    let_bodies_in(model, state, readout, grid, me.world)
                    grid.outside[me.world] = 0
            grid.touching[me.world] = 0
            if wp.static(shares_entries(f)):
                no_entries(grid, me.world)
            grid.clock[me.world] = grid.clock[me.world] + wp.int64(1)
        keep_together()

    return finish


def steps_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, grid, push, me, first_step, steps, last_step, turns)`: steps of a world."""
    check_one = check_term(f) if f.contacts else None
    renew_lists = renew_lists_term(f) if f.contacts else None
    take_stages, finish = stages_term(f), finish_term(f)

    @wp.func
    def take_steps(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData,
        me: Lane, first_step: wp.int64, steps: int, last_step: wp.int64, turns: int,
    ):  # fmt: skip
        """Take `steps` steps from `first_step`, of a call that ends at `last_step`, together with the other lanes."""
        if me.lane == 0:
            grid.clock[me.world] = first_step
            grid.until[me.world] = last_step
            if wp.static(shares_entries(f)):
                no_entries(grid, me.world)
        if wp.static(f.contacts):
            first = me.world * grid.near.elements
            for i in range(first + me.lane, first + grid.near.elements, me.lanes):
                check_one(model, state, grid, me.world, i)
        keep_together()
        for _ in range(steps):
            if wp.static(f.contacts):
                renew_lists(model, state, grid, me)
            take_stages(model, control, state, readout, grid, push, me, turns)
            finish(model, control, state, readout, grid, push, me)

    return take_steps


def make_world_of_many_step(f: Features) -> wp.Kernel:
    """Kernel over (world, lane): many steps of a world of many bodies; with episodes, of one in motion."""
    take_steps, world_at, start_of = steps_term(f), world_term(f), start_term(f)
    how = {"grid_stride": False, "launch_bounds": (WORLD_BLOCK, 1), "module_options": f.module_options}

    @wp.kernel(module="unique", enable_backward=False, **how)
    def world_of_many(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData,
        lanes: int, first_world: int, first_step: wp.int64, steps: int, last_step: wp.int64, turns: int,
    ):  # fmt: skip
        """Take `steps` steps from `first_step`, of a call that ends at `last_step`, in the worlds from `first_world`.

        A world is gone through by `lanes` threads, all of one block, which may hold several worlds; contacts in `turns`
        rounds at most where they take turns.
        """
        row, lane = wp.tid()
        world = world_at(model, first_world + row)
        if world < 0:
            return
        me = Lane(world, lane, lanes, seat_of(lanes))
        start, end = start_of(model, world, first_step), start_of(model, world, last_step)
        take_steps(model, control, state, readout, grid, push, me, start, steps, end, turns)

    return world_of_many
