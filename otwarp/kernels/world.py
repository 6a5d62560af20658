"""The `world` driver: a few bodies that may touch, one thread per world, state in local arrays for many steps."""

import warp as wp

from otwarp.kernels.body import free_move_term, move_trap_term
from otwarp.kernels.contact import UNSETTLED, Contact
from otwarp.kernels.detect import obstacle_contacts_term, pair_contacts_term
from otwarp.kernels.escapes import escape_term
from otwarp.kernels.faults import Fault, finite, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.solve import apply_loads, solve_contacts
from otwarp.kernels.types import ControlData, ModelData, Pose, ReadoutData, StateData


def find_contacts_term(f: Features) -> wp.Function:
    """`(model, readout, world, position, rotation, contacts, step, time) -> count`: all contacts of a world."""
    pair_contacts = pair_contacts_term(f) if f.pairs else None
    obstacle_contacts = obstacle_contacts_term(f) if f.obstacles else None

    @wp.func
    def find_contacts(
        model: ModelData,
        readout: ReadoutData,
        world: int,
        position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat),
        contacts: wp.array(dtype=Contact),
        step: wp.int64,
        time: wp.float64,
    ) -> int:
        """Every body against the obstacles and against the bodies before it."""
        bodies = int(wp.static(f.bodies))
        count = int(0)
        for a in range(bodies):
            pose_a = Pose(position[a], rotation[a])
            if wp.static(bool(f.obstacles)):
                count = obstacle_contacts(model, readout, world, a, pose_a, contacts, count, step, time)
            if wp.static(f.pairs):
                for b in range(a):
                    pose_b = Pose(position[b], rotation[b])
                    count = pair_contacts(model, readout, world, a, b, pose_a, pose_b, contacts, count, step)
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
            position[b] = position[b] + linear[b]
            if wp.static(f.rigid):
                rotation[b] = rotate_by(rotation[b], angular[b])
            if wp.static(f.escapes):
                time = wp.float64(step) * model.time_step
                pose = Pose(position[b], rotation[b])
                note_escapes(model, control, state, readout, world, b, pose, step, time)

    return take_moves


def make_world_step(f: Features) -> wp.Kernel:
    """Step for a few bodies that may touch: one thread per world, state in local arrays for all `steps`."""
    free_move = free_move_term(f)
    move_trap = move_trap_term(f) if f.speed_limits else None
    find_contacts = find_contacts_term(f) if f.contacts else None
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
        for b in range(bodies):
            position[b] = state.position[world, b]
            rotation[b] = wp.quat_identity()
            if wp.static(f.rigid):
                rotation[b] = state.orientation[world, b]
        if wp.static(f.contacts):
            contacts = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=Contact)
            matrix = wp.zeros(shape=(wp.static(f.max_contacts * f.max_contacts),), dtype=float)
            free = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            right = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            pivot = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=float)
            order = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=int)
            on = wp.zeros(shape=(wp.static(f.max_contacts),), dtype=int)
        for i in range(steps):
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            if wp.static(f.speed_limits):
                for trap in range(model.traps.axis.shape[0]):
                    move_trap(model, control, state, world, trap, time)
            for b in range(bodies):
                move = free_move(model, control, state, world, b, Pose(position[b], rotation[b]), step, time)
                linear[b] = move.linear
                angular[b] = move.angular
            if wp.static(f.contacts):
                count = find_contacts(model, readout, world, position, rotation, contacts, step, time)
                error = solve_contacts(contacts, count, linear, angular, matrix, free, right, pivot, order, on)
                if error > UNSETTLED * contacts[0].radius:
                    raise_fault(readout, world, contacts[0].a, wp.static(int(Fault.UNSETTLED)), step)
                apply_loads(contacts, count, linear, angular)
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
