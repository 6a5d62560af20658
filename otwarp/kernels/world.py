"""The `world` driver: a few bodies that may touch, one thread per world, state in local arrays for many steps."""

import warp as wp

from otwarp.kernels.body import body_dynamics
from otwarp.kernels.contact import UNSETTLED, Contact
from otwarp.kernels.detect import obstacle_contacts_term, pair_contacts_term
from otwarp.kernels.escapes import escape_term
from otwarp.kernels.faults import Fault, finite, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.integrators import INTEGRATORS
from otwarp.kernels.rigid import angular_part, linear_part, twist
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.solve import solve_contacts
from otwarp.kernels.trap_wrench import move_trap_term
from otwarp.kernels.travel import free_travel, thermal_reach, wander_of
from otwarp.kernels.types import ControlData, ModelData, Move, Pose, ReadoutData, StateData, vec6
from otwarp.kernels.walls import out_of_walls

PUSHED = wp.constant(0.1)
"""How far one body pushes another beyond its own free move in one step at most, relative to its bounding sphere."""


@wp.func
def bounded(bodies: int, linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3)) -> bool:
    """Whether all free moves are finite and of a size that a scene can have."""
    good = bool(True)
    for b in range(bodies):
        good = good and finite(linear[b]) and finite(angular[b])
    return good


def find_contacts_term(f: Features) -> wp.Function:
    """`(model, readout, world, position, rotation, linear, angular, contacts, step, time) -> count` of a world.

    A gap is a contact if the free moves of its bodies may close it, others pushing as far as the farthest of them, or
    if its path may touch in between.
    """
    pair_contacts = pair_contacts_term(f) if f.pairs else None
    obstacle_contacts = obstacle_contacts_term(f) if f.obstacles else None

    @wp.func
    def find_contacts(
        model: ModelData,
        readout: ReadoutData,
        world: int,
        position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat),
        linear: wp.array(dtype=wp.vec3),
        angular: wp.array(dtype=wp.vec3),
        contacts: wp.array(dtype=Contact),
        step: wp.int64,
        time: wp.float64,
    ) -> int:
        """Every body against the obstacles and against the bodies before it."""
        bodies = int(wp.static(f.bodies))
        count = int(0)
        farthest = float(0.0)
        if wp.static(f.brownian):
            wander = wp.zeros(shape=(wp.static(f.bodies),), dtype=float)
        for a in range(bodies):
            farthest = wp.max(farthest, free_travel(model, a, Move(linear[a], angular[a])))
            if wp.static(f.brownian):
                wander[a] = wander_of(model, world, a)
        for a in range(bodies):
            pose_a = Pose(position[a], rotation[a])
            move_a = Move(linear[a], angular[a])
            pushed = wp.min(farthest, PUSHED * model.body.bound[a])
            if wp.static(bool(f.obstacles)):
                near = pushed
                if wp.static(f.brownian):
                    near = wp.max(near, thermal_reach(wander[a]))
                count = obstacle_contacts(model, readout, world, a, pose_a, move_a, near, contacts, count, step, time)
            if wp.static(f.pairs):
                for b in range(a):
                    pose_b = Pose(position[b], rotation[b])
                    move_b = Move(linear[b], angular[b])
                    near = pushed
                    if wp.static(f.brownian):
                        near = wp.max(near, thermal_reach(wander[a] + wander[b]))
                    count = pair_contacts(
                        model, readout, world, a, b, pose_a, pose_b, move_a, move_b, near, contacts, count, step
                    )  # fmt: skip
        return count

    return find_contacts


@wp.func
def report_contacts(readout: ReadoutData, world: int, bodies: int, contacts: wp.array(dtype=Contact), count: int):
    """Net contact force and sum of the normal forces of every body, from the solved contacts."""
    for b in range(bodies):
        force = wp.vec3(0.0)
        load = float(0.0)
        for i in range(count):
            c = contacts[i]
            if c.a == b:
                force += c.load * c.normal
                load += wp.abs(c.load)
            if c.b == b:
                force -= c.load * c.normal
                load += wp.abs(c.load)
        readout.contact_force[world, b] = force
        readout.contact_load[world, b] = load


@wp.func
def all_good(
    readout: ReadoutData,
    world: int,
    bodies: int,
    position: wp.array(dtype=wp.vec3),
    linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
    step: wp.int64,
) -> bool:
    """Whether the step may be taken: every move is finite and no body of the world has a fault."""
    good = bool(True)
    for b in range(bodies):
        if not finite(position[b] + linear[b] + angular[b]):
            raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
        if readout.fault[world, b] != 0:
            good = False
    return good


def take_moves_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, world, position, rotation, linear, angular, step)`: arrive at `step`."""
    note_escapes = escape_term(f) if f.escapes else None

    @wp.func
    def take_moves(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        world: int,
        position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat),
        linear: wp.array(dtype=wp.vec3),
        angular: wp.array(dtype=wp.vec3),
        step: wp.int64,
    ):
        """Move and turn every body, and note what its traps have lost."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            before = Pose(position[b], rotation[b])
            position[b] = position[b] + linear[b]
            if wp.static(f.rigid):
                rotation[b] = rotate_by(rotation[b], angular[b])
            if wp.static(f.walls > 0):
                position[b] = position[b] + out_of_walls(model.walls, b, Pose(position[b], rotation[b]))
            if wp.static(f.escapes):
                time = wp.float64(step) * model.time_step
                pose = Pose(position[b], rotation[b])
                note_escapes(model, control, state, readout, world, b, before, pose, step, time)

    return take_moves


def settle_term(f: Features) -> wp.Function:
    """Solve the contacts of a world for the free moves `linear` and `angular`, and add what their forces move."""

    @wp.func
    def settle(
        readout: ReadoutData,
        world: int,
        contacts: wp.array(dtype=Contact),
        count: int,
        linear: wp.array(dtype=wp.vec3),
        angular: wp.array(dtype=wp.vec3),
        matrix: wp.array(dtype=float),
        free: wp.array(dtype=float),
        right: wp.array(dtype=float),
        pivot: wp.array(dtype=float),
        order: wp.array(dtype=int),
        on: wp.array(dtype=int),
        step: wp.int64,
    ):
        """A fault where no solution is found."""
        # a free move without bound is the fault that `all_good` reports
        sane = bounded(int(wp.static(f.bodies)), linear, angular)
        error = solve_contacts(contacts, count, linear, angular, matrix, free, right, pivot, order, on)
        if error > UNSETTLED * contacts[0].radius and sane:
            raise_fault(readout, world, contacts[0].a, wp.static(int(Fault.UNSETTLED)), step)

    return settle


def make_world_step(f: Features) -> wp.Kernel:
    """Step for a few bodies that may touch: one thread per world, state in local arrays for all `steps`.

    A two-stage integrator looks again from where the bodies came to with their contacts; the contacts are then solved
    once more. A predictor without them would push a trapped body through what it presses on.
    """
    scheme = INTEGRATORS[f.integrator]
    constants_of, dynamics = body_dynamics(f)
    predict = scheme.predict(dynamics)
    correct = scheme.correct(dynamics) if scheme.correct is not None else None
    move_trap = move_trap_term(f) if f.speed_limits else None
    find_contacts = find_contacts_term(f) if f.contacts else None
    settle = settle_term(f) if f.contacts else None
    take_moves = take_moves_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options={"fast_math": f.fast_math})
    def world_step(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        first_world: int,
        first_step: wp.int64,
        steps: int,
    ):
        """Take `steps` steps from `first_step` for the worlds from `first_world` on."""
        world = first_world + wp.tid()
        bodies = int(wp.static(f.bodies))
        position = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        rotation = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.quat)
        linear = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        angular = wp.zeros(shape=(wp.static(f.bodies),), dtype=wp.vec3)
        free = wp.zeros(shape=(wp.static(f.bodies),), dtype=vec6)
        drift = wp.zeros(shape=(wp.static(f.bodies),), dtype=vec6)
        for b in range(bodies):
            position[b] = state.position[world, b]
            rotation[b] = wp.quat_identity()
            if wp.static(f.rigid):
                rotation[b] = state.orientation[world, b]
        if wp.static(f.contacts):
            contacts = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=Contact)
            matrix = wp.zeros(shape=(wp.static(f.max_contacts * f.max_contacts),), dtype=float)
            gap = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            right = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            pivot = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            order = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=int)
            on = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=int)
        for i in range(steps):
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            for b in range(bodies):
                body = constants_of(model, control, world, b)
                pose = Pose(position[b], rotation[b])
                move, now = predict(model, control, state, body, world, b, pose, step, time)
                free[b] = move
                drift[b] = now
                linear[b] = linear_part(move)
                angular[b] = angular_part(move)
            if wp.static(f.speed_limits):
                for trap in range(model.traps.axis.shape[0]):
                    move_trap(model, control, state, world, trap, time)
            if wp.static(f.contacts):
                count = find_contacts(
                    model, readout, world, position, rotation, linear, angular, contacts, step, time
                )  # fmt: skip
                settle(readout, world, contacts, count, linear, angular, matrix, gap, right, pivot, order, on, step)
            if wp.static(correct is not None):
                for b in range(bodies):
                    body = constants_of(model, control, world, b)
                    pose = Pose(position[b], rotation[b])
                    moved = twist(linear[b], angular[b])
                    move = free[b] + correct(model, control, state, body, world, b, pose, drift[b], moved, step, time)
                    linear[b] = linear_part(move)
                    angular[b] = angular_part(move)
                if wp.static(f.contacts):
                    settle(readout, world, contacts, count, linear, angular, matrix, gap, right, pivot, order, on, step)
            if wp.static(f.contacts):
                if i == steps - 1:
                    report_contacts(readout, world, bodies, contacts, count)
            if not all_good(readout, world, bodies, position, linear, angular, step):
                break
            take_moves(model, control, state, readout, world, position, rotation, linear, angular, step + wp.int64(1))
        for b in range(bodies):
            state.position[world, b] = position[b]
            if wp.static(f.rigid):
                state.orientation[world, b] = rotation[b]

    return world_step
