"""The `world` driver: a few bodies that may touch, one thread per world, bodies in local arrays for many steps."""

from dataclasses import dataclass

import warp as wp

from otwarp.kernels.bodies.rigid import angular_part, linear_part, twist
from otwarp.kernels.contact.blocks import block_count
from otwarp.kernels.contact.body_solve import nodes_of
from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BodyConstants
from otwarp.kernels.core.team import team_of
from otwarp.kernels.core.types import ControlData, ModelData, Pose, ReadoutData, StateData, vec6
from otwarp.kernels.core.worlds import living_world, own_step
from otwarp.kernels.drivers.world_contacts import find_contacts_term, report_contacts_term, settle_term
from otwarp.kernels.drivers.world_moves import finish_term
from otwarp.kernels.drivers.world_room import (
    BodyRoom,
    CarryRoom,
    ContactRoom,
    Found,
    SolveRoom,
    WorldScratch,
    constants_term,
    keep_constants_term,
    list_in_term,
    list_of,
    load_bodies_term,
    solve_room_in,
    store_bodies_term,
)
from otwarp.kernels.integrate.body import body_dynamics
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.kernels.optics.trap_command import move_trap_term


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    __syncthreads();
#endif
""")
def keep_together():
    """Wait until all threads of the block are here; those that have left do not count.

    A step is more code than the instruction cache of a multiprocessor holds: threads that go through it together fetch
    it once.
    """
    ...


def move_traps_term(f: Features) -> wp.Function:
    """`(model, control, state, world, time)`: move the foci of all traps towards where they are commanded.

    Each thread of the team moves others.
    """
    move_trap, team = move_trap_term(f), team_of(f)
    size_of, lane_of = team.size, team.lane

    @wp.func
    def move_traps(model: ModelData, control: ControlData, state: StateData, world: int, time: wp.float64):
        """Move all foci one step on from `time` [s], none faster than its speed limit [µm/s]."""
        for trap in range(lane_of(), model.traps.axis.shape[0], size_of()):
            move_trap(model, control, state, world, trap, time)

    return move_traps


def predict_body_term(f: Features) -> wp.Function:
    """`(model, control, state, world, b, body, step, time)`: the integrator's first stage of body b by itself."""
    constants_of, dynamics = constants_term(f), body_dynamics(f)[1]
    predict = INTEGRATORS[f.integrator].predict(dynamics)
    lane_of = team_of(f).lane

    @wp.func
    def predict_body(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, body: BodyRoom, step: wp.int64,
        time: wp.float64,
    ):  # fmt: skip
        """Write its free move and its drift [µm, rad]."""
        constants = constants_of(model, control, world, b, body)
        pose = Pose(body.position[b], body.rotation[b])
        move, now = predict(model, control, state, constants, world, b, pose, step, time)
        if lane_of() == 0:
            body.free[b] = move
            body.drift[b] = now
            body.linear[b] = linear_part(move)
            body.angular[b] = angular_part(move)

    return predict_body


def predict_all_term(f: Features) -> wp.Function:
    """`predict` of `Stages`: each body by itself."""
    predict_body = predict_body_term(f)

    @wp.func
    def predict_all(
        model: ModelData, control: ControlData, state: StateData, world: int, body: BodyRoom, carry: CarryRoom,
        step: wp.int64, time: wp.float64,
    ):  # fmt: skip
        """Free moves and drifts [µm, rad] of the integrator's first stage, body by body."""
        # a variable: Warp would write out a loop over a constant body by body
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            predict_body(model, control, state, world, b, body, step, time)

    return predict_all


def correct_body_term(f: Features) -> wp.Function | None:
    """`(model, control, state, world, b, body, step, time)`: the integrator's second stage of body b by itself."""
    scheme = INTEGRATORS[f.integrator]
    if scheme.correct is None:
        return None
    constants_of, dynamics = constants_term(f), body_dynamics(f)[1]
    correct = scheme.correct(dynamics)
    lane_of, wait = team_of(f).lane, team_of(f).wait

    @wp.func
    def correct_body(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, body: BodyRoom, step: wp.int64,
        time: wp.float64,
    ):  # fmt: skip
        """Write its free move [µm, rad] as it is by both stages."""
        constants = constants_of(model, control, world, b, body)
        pose = Pose(body.position[b], body.rotation[b])
        moved = twist(body.linear[b], body.angular[b])
        more = correct(model, control, state, constants, world, b, pose, body.drift[b], moved, step, time)
        move = body.free[b] + more
        drift = body.free[b] - moved - more
        wait()
        if lane_of() == 0:
            if wp.static(f.bends):
                # so that free − drift is the whole move by the contact forces so far; the drift itself has served
                body.drift[b] = drift
            body.linear[b] = linear_part(move)
            body.angular[b] = angular_part(move)

    return correct_body


def correct_all_term(f: Features) -> wp.Function | None:
    """`correct` of `Stages`: each body by itself."""
    correct_body = correct_body_term(f)
    if correct_body is None:
        return None

    @wp.func
    def correct_all(
        model: ModelData, control: ControlData, state: StateData, world: int, body: BodyRoom, carry: CarryRoom,
        step: wp.int64, time: wp.float64,
    ):  # fmt: skip
        """Free moves [µm, rad] with the integrator's second stage, body by body."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            correct_body(model, control, state, world, b, body, step, time)

    return correct_all


@dataclass(frozen=True, kw_only=True)
class Stages:
    """What a step of a world is made of, on a `BodyRoom`, a `ContactRoom` and a `CarryRoom`.

    Attributes:
        predict: `(model, control, state, world, body, carry, step, time)`: free moves of the integrator's first stage.
        correct: Likewise the second, from where the bodies came to with their contacts, which are then solved once
            more: a predictor without them would push a trapped body through what it presses on. None for one-stage
            schemes.
        find: `(model, readout, world, body, room, carry, step, time) -> Found`; None where nothing touches.
        settle: `(model, readout, world, body, room, carry, found, again, step)`: add what the contacts move to the free
            moves; `again` in the second stage.
    """

    predict: wp.Function
    correct: wp.Function | None
    find: wp.Function | None
    settle: wp.Function | None


def make_world_step(f: Features) -> wp.Kernel:
    """Step for a few bodies that may touch."""
    return make_step_of(
        f,
        Stages(
            predict=predict_all_term(f),
            correct=correct_all_term(f),
            find=find_contacts_term(f) if f.contacts else None,
            settle=settle_term(f) if f.contacts else None,
        ),
    )


def take_step_term(f: Features, stages: Stages) -> wp.Function:
    """`(model, control, state, readout, world, body, room, carry, step, report) -> bool`: one step of one world."""
    predict, correct, find_contacts, settle = stages.predict, stages.correct, stages.find, stages.settle
    move_traps = move_traps_term(f) if f.speed_limits else None
    report_contacts = report_contacts_term(f) if f.contacts else None
    finish = finish_term(f)

    @wp.func
    def take_step(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, world: int, body: BodyRoom,
        room: ContactRoom, carry: CarryRoom, step: wp.int64, report: bool,
    ) -> bool:  # fmt: skip
        """Take a step, and write the contact forces if they are wanted; false, and nothing moved, after a fault."""
        time = wp.float64(step) * model.time_step
        found = Found()
        stages = int(wp.static(1 if correct is None else 2))
        # a loop, so that the code of the contacts is there once: a GPU fetches instructions slower than it runs them
        for stage in range(stages):
            if stage == 0:
                predict(model, control, state, world, body, carry, step, time)
                if wp.static(f.speed_limits):
                    move_traps(model, control, state, world, time)
                if wp.static(f.contacts):
                    found = find_contacts(model, readout, world, body, room, carry, step, time)
            elif wp.static(correct is not None):
                correct(model, control, state, world, body, carry, step, time)
            keep_together()
            if wp.static(f.contacts):
                settle(model, readout, world, body, room, carry, found, stage > 0, step)
            keep_together()
        if wp.static(f.contacts):
            if report:
                report_contacts(readout, world, room.listed, found.count)
        return finish(model, control, state, readout, world, body, step)

    return take_step


def world_of_thread_term(f: Features) -> wp.Function:
    """`(model, turn, spread, first_world, first_step) -> (world, step)` of a thread: world -1 if it has none."""

    @wp.func
    def world_of_thread(model: ModelData, turn: int, spread: int, first_world: int, first_step: wp.int64):
        """The world of every `spread`-th thread, and the step from which its own clock goes on."""
        world = int(-1)
        start = first_step
        if turn % spread == 0:
            world = first_world + turn // spread
        if wp.static(f.episodes):
            if world >= 0:
                world = living_world(model, world)
            if world >= 0:
                start = own_step(model, world, first_step)
        return world, start

    return world_of_thread


def make_step_of(f: Features, stages: Stages) -> wp.Kernel:
    """One thread per world, bodies in local arrays for all `steps`."""
    take_step, world_of = take_step_term(f, stages), world_of_thread_term(f)
    list_in, load_bodies, store_bodies = list_in_term(f), load_bodies_term(f), store_bodies_term(f)
    keep_constants = keep_constants_term(f) if f.cached else None
    how = {"grid_stride": False, "launch_bounds": f.launch_bounds, "module_options": f.module_options}

    @wp.kernel(module="unique", enable_backward=False, **how)
    def world_step(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, scratch: WorldScratch,
        spread: int, shared_row: int, first_world: int, first_step: wp.int64, steps: int,
    ):  # fmt: skip
        """Take `steps` steps from `first_step` for the worlds from `first_world` on, one world every `spread` threads.

        Few worlds are spread over more threads than they need: those of a warp wait for each other wherever their
        contacts differ. `shared_row` is the row of the scratch that these worlds use in turn, or −1: each has its own.
        """
        turn = wp.tid()
        world, start = world_of(model, turn, spread, first_world, first_step)
        if world < 0:
            return
        row = wp.where(shared_row < 0, turn // spread, shared_row)
        position = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        rotation = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.quat)
        linear = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        angular = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        free = wp.zeros(shape=(wp.static(f.bodies),), dtype=vec6)
        drift = wp.zeros(shape=(wp.static(f.bodies),), dtype=vec6)
        body = BodyRoom()
        body = BodyRoom(position, rotation, linear, angular, free, drift, body.constants)
        if wp.static(f.cached):
            constants = wp.zeros(shape=(wp.static(f.bodies),), dtype=BodyConstants)
            body = BodyRoom(position, rotation, linear, angular, free, drift, constants)
            keep_constants(model, control, world, body)
        carry = CarryRoom()
        if wp.static(f.coupling):
            pair = wp.zeros(shape=(wp.static(block_count(f.bodies)),), dtype=wp.mat33)
            root = wp.zeros(shape=(wp.static(block_count(f.bodies)),), dtype=wp.mat33)
            force = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
            there = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
            turned = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.quat)
            later = wp.zeros(shape=(wp.static(f.bodies),), dtype=vec6)
            carry = CarryRoom(pair, root, force, there, turned, later)
        room = ContactRoom()
        if wp.static(f.contacts):
            if wp.static(f.keeps):
                whole = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=Contact)
                matrix = wp.zeros(shape=(wp.static(f.max_contacts**2),), dtype=float)
                gap = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
                right = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
                pivot = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
                order = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=int)
                on = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=int)
                room = ContactRoom(list_of(whole), SolveRoom(matrix, gap, right, pivot, order, on), room.moved)
            elif wp.static(f.body_space):
                moved = wp.zeros(shape=(wp.static(nodes_of(f)),), dtype=wp.vec3)
                room = ContactRoom(list_in(scratch, row), room.solve, moved)
            else:
                room.listed = list_in(scratch, row)
                room.solve = solve_room_in(scratch, row)
        load_bodies(state, world, body)
        for i in range(steps):
            step = start + wp.int64(i)
            if not take_step(model, control, state, readout, world, body, room, carry, step, i == steps - 1):
                break
        store_bodies(state, world, body)

    return world_step
