"""The `world` driver in phases: a kernel for each stage of a step, for scenes and devices where one for all is slow.

A GPU fetches instructions slower than it runs them, and a step of bodies that turn and touch is more code than a
multiprocessor caches: here each kernel is small, runs for all worlds before the next, and has a thread for each body
or world; or where worlds are few a team of threads, since a step of few worlds lasts as long as its slowest thread. The
functions are those of `world`, so that results are the same; what a stage finds out stays in `WorldScratch`. The number
of the step is read from a clock, so that a graph of many steps can be replayed.
"""

from dataclasses import dataclass, replace
from typing import Any

import warp as wp

from otwarp.kernels.contact.body_solve import settling_team
from otwarp.kernels.contact.obstacles import moving_pose
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.keyframes import sampled_value
from otwarp.kernels.core.team import ALONE, team_of
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData
from otwarp.kernels.core.worlds import start_term, world_term
from otwarp.kernels.drivers.world import correct_body_term, move_traps_term, predict_body_term
from otwarp.kernels.drivers.world_contacts import find_contacts_term, report_contacts_term, settle_term
from otwarp.kernels.drivers.world_moves import finish_term
from otwarp.kernels.drivers.world_room import (
    CarryRoom,
    ContactRoom,
    Found,
    WorldScratch,
    bodies_in_term,
    list_in_term,
    solve_room_in,
)

BLOCK = 64
"""Threads of a block: few, so that few worlds are spread over more multiprocessors."""

FREE_BLOCKS, FIND_BLOCKS, SETTLE_BLOCKS = 8, 6, 6
"""Blocks that a multiprocessor is to hold: 128 and 168 registers a thread, in place of 255."""


@dataclass(frozen=True, kw_only=True)
class WorldPhases:
    """The kernels of a step, in the order of their launches; None where there is nothing to do.

    Attributes:
        look: Looks key frames up for some steps: one thread per step and trap or obstacle.
        predict: Free moves of the integrator's first stage: one thread per body.
        find: Moves traps and lists contacts: a team per world.
        settle: Solves the contacts, in the first stage and again in the second: a team or a thread per world.
        correct: The second stage: one thread per body.
        finish: Takes the moves: a team per world.
        report: After the last step of a call, writes the contact forces: one thread per world.
        settled_together: Whether a team settles.
    """

    look: wp.Kernel | None
    predict: wp.Kernel
    find: wp.Kernel | None
    settle: wp.Kernel | None
    correct: wp.Kernel | None
    finish: wp.Kernel
    report: wp.Kernel | None
    settled_together: bool

    @property
    def all(self) -> list[wp.Kernel]:
        """Those that there are."""
        each = (self.look, self.predict, self.find, self.settle, self.correct, self.finish, self.report)
        return [kernel for kernel in each if kernel is not None]


def make_world_phases(f: Features) -> WorldPhases:
    """Kernels of a step of a few bodies that do not carry each other along."""
    moving = f.moving_traps or f.moving_obstacles
    # worlds with clocks of their own are at other times, and stages may be told other commands than steps
    f = replace(f, looks_once=moving and not (f.episodes or f.leaps))
    correct = correct_body_term(f)
    return WorldPhases(
        look=make_look(f) if f.looks_once else None,
        predict=make_free_stage(f, predict_body_term(f)),
        find=make_find(f) if f.contacts or f.speed_limits else None,
        settle=make_settle(f) if f.contacts else None,
        correct=make_free_stage(f, correct) if correct is not None else None,
        finish=make_finish(f),
        report=make_report(f) if f.contacts else None,
        settled_together=settling_team(f) is not ALONE,
    )


def kernel_of(f: Features, blocks: int) -> Any:
    """Decorator of a kernel of which so many blocks are to fit on a multiprocessor; float64 needs all registers."""
    options = {**f.module_options, "block_dim": BLOCK}
    # teams are few, and each has all the registers that it can use
    bounds = (BLOCK,) if f.precision == "float64" or f.team > 1 else (BLOCK, blocks)
    how = {"grid_stride": False, "launch_bounds": bounds, "module_options": options}
    return wp.kernel(module="unique", enable_backward=False, **how)


def place_term(f: Features) -> wp.Function:
    """`(model, readout, place, clock, ahead) -> (world, step)` that a thread takes: world -1 if it takes none."""
    world_of, step_of = world_term(f), start_term(f)

    @wp.func
    def place_of(model: ModelData, readout: ReadoutData, place: int, clock: wp.array(dtype=wp.int64), ahead: int):
        """World and number of the step; none where a body has a fault, which stops its world."""
        world = world_of(model, place)
        step = wp.int64(0)
        if world >= 0:
            step = step_of(model, world, clock[0] + wp.int64(ahead))
            bodies = int(wp.static(f.bodies))
            faults = int(0)
            for b in range(bodies):
                faults += readout.fault[world, b]
            world = wp.where(faults == 0, world, -1)
        return world, step

    return place_of


def make_look(f: Features) -> wp.Kernel:
    """Kernel over (steps, traps and obstacles): look their key frames up."""

    @kernel_of(f, FREE_BLOCKS)
    def look(model: ModelData, clock: wp.array(dtype=wp.int64), ahead: int):
        """Write what they say at the times of the steps from `ahead` on after the clock's."""
        row, n = wp.tid()
        step = clock[0] + wp.int64(ahead)
        time = wp.float64(step + wp.int64(row)) * model.time_step
        traps = model.traps
        if row == 0 and n == 0:
            traps.step_times.first[0] = step
        if wp.static(f.moving_traps):
            if n < wp.static(f.traps):
                first = traps.key_start[n]
                last = traps.key_start[n + 1] - 1
                if last > first:
                    value = sampled_value(traps.key_time, traps.key_value, first, last, time)
                    traps.step_value[row, n] = value
        if wp.static(f.moving_obstacles):
            o = n - wp.static(f.traps)
            if o >= 0:
                pose = moving_pose(model.obstacles, o, time)
                model.obstacles.step_position[row, o] = pose.position
                model.obstacles.step_rotation[row, o] = pose.rotation

    return look


def make_free_stage(f: Features, stage: wp.Function) -> wp.Kernel:
    """Kernel over (bodies, threads of teams) of a stage of the integrator: threads of a warp have the same body."""
    place_of, bodies_in = place_term(f), bodies_in_term(f)

    size_of = team_of(f).size

    @kernel_of(f, FREE_BLOCKS)
    def free_stage(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, scratch: WorldScratch,
        clock: wp.array(dtype=wp.int64), ahead: int,
    ):  # fmt: skip
        """Move body b of each world as if it touched nothing."""
        b, thread = wp.tid()
        place = thread // size_of()
        world, step = place_of(model, readout, place, clock, ahead)
        if world < 0:
            return
        body = bodies_in(state, scratch, world, place)
        stage(model, control, state, world, b, body, step, wp.float64(step) * model.time_step)

    return free_stage


def make_find(f: Features) -> wp.Kernel:
    """Kernel over threads of teams: move the traps that the first stage has seen, and list what may touch."""
    place_of, bodies_in, list_in = place_term(f), bodies_in_term(f), list_in_term(f)
    move_traps = move_traps_term(f) if f.speed_limits else None
    find_contacts = find_contacts_term(f) if f.contacts else None
    size_of, lane_of = team_of(f).size, team_of(f).lane

    @kernel_of(f, FIND_BLOCKS)
    def find(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, scratch: WorldScratch,
        clock: wp.array(dtype=wp.int64), ahead: int,
    ):  # fmt: skip
        """Move foci, and write the contacts of each world and their number."""
        place = wp.tid() // size_of()
        world, step = place_of(model, readout, place, clock, ahead)
        if world < 0:
            return
        time = wp.float64(step) * model.time_step
        if wp.static(f.speed_limits):
            move_traps(model, control, state, world, time)
        if wp.static(f.contacts):
            room = ContactRoom()
            room.listed = list_in(scratch, place)
            body = bodies_in(state, scratch, world, place)
            found = find_contacts(model, readout, world, body, room, CarryRoom(), step, time)
            if lane_of() == 0:
                scratch.count[place] = found.count
                scratch.partners[place] = found.partners

    return find


def make_settle(f: Features) -> wp.Kernel:
    """Kernel over threads of teams, or over worlds: solve the contacts."""
    place_of, bodies_in, list_in = place_term(f), bodies_in_term(f), list_in_term(f)
    settle_contacts, size_of = settle_term(f), settling_team(f).size

    @kernel_of(f, SETTLE_BLOCKS)
    def settle(
        model: ModelData, state: StateData, readout: ReadoutData, scratch: WorldScratch,
        clock: wp.array(dtype=wp.int64), ahead: int, again: int,
    ):  # fmt: skip
        """Add to the moves of all bodies what their contacts move; `again` in the second stage."""
        place = wp.tid() // size_of()
        world, step = place_of(model, readout, place, clock, ahead)
        if world < 0:
            return
        room = ContactRoom()
        room.listed = list_in(scratch, place)
        if wp.static(f.body_space):
            room.moved = scratch.moved[place]
        else:
            room.solve = solve_room_in(scratch, place)
        body = bodies_in(state, scratch, world, place)
        found = Found(scratch.count[place], scratch.partners[place])
        settle_contacts(model, readout, world, body, room, CarryRoom(), found, again != 0, step)

    return settle


def make_finish(f: Features) -> wp.Kernel:
    """Kernel over threads of teams: take the moves of the step."""
    place_of, bodies_in, finish_step = place_term(f), bodies_in_term(f), finish_term(f)
    size_of = team_of(f).size

    @kernel_of(f, FREE_BLOCKS)
    def finish(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, scratch: WorldScratch,
        clock: wp.array(dtype=wp.int64), ahead: int,
    ):  # fmt: skip
        """Arrive at the end of the step, unless a body has a fault."""
        place = wp.tid() // size_of()
        world, step = place_of(model, readout, place, clock, ahead)
        if world < 0:
            return
        finish_step(model, control, state, readout, world, bodies_in(state, scratch, world, place), step)

    return finish


def make_report(f: Features) -> wp.Kernel:
    """Kernel over worlds: write the contact forces of the last step."""
    place_of, list_in, report_contacts = place_term(f), list_in_term(f), report_contacts_term(f)

    @kernel_of(f, FREE_BLOCKS)
    def report(model: ModelData, readout: ReadoutData, scratch: WorldScratch, clock: wp.array(dtype=wp.int64)):
        """Net forces and loads [pN] of each world that has no fault."""
        place = wp.tid()
        world, _ = place_of(model, readout, place, clock, 0)
        if world < 0:
            return
        report_contacts(readout, world, list_in(scratch, place), scratch.count[place])

    return report


@wp.kernel(enable_backward=False)
def tick(clock: wp.array(dtype=wp.int64), steps: int):
    """Turn the clock on by so many steps."""
    clock[0] = clock[0] + wp.int64(steps)
