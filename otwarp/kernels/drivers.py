"""The two world drivers: one thread owns what it steps and takes many steps before it writes back."""

import warp as wp

from otwarp.kernels.body import free_move_term, trap_command_term
from otwarp.kernels.contact import SWEEPS, Contact, solve_contacts
from otwarp.kernels.detect import obstacle_contacts_term, pair_contacts_term
from otwarp.kernels.faults import Fault, finite, raise_fault
from otwarp.kernels.features import MAX_CONTACTS, Features
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.traps import commanded_animated, commanded_still, limited_focus
from otwarp.kernels.types import ControlData, ModelData, Pose, ReadoutData, StateData


def escape_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, world, b, pose, step, time)`: note the first step a held sphere is lost."""
    trap_command = trap_command_term(f)

    @wp.func
    def note_escapes(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        world: int,
        b: int,
        pose: Pose,
        step: wp.int64,
        time: wp.float64,
    ):
        for trap in range(model.traps.axis.shape[0]):
            if model.traps.held_body[trap] == b:
                command = trap_command(model, control, state, world, trap, time)
                anchor = wp.vec3(command[0], command[1], command[2])
                anchor += model.traps.equilibrium[trap] * model.traps.axis[trap]
                held = pose.position + wp.quat_rotate(pose.rotation, model.traps.held_offset[trap])
                away = held - anchor
                if wp.length_sq(away) > model.traps.held_range[trap] * model.traps.held_range[trap]:
                    if readout.escape_step[world, trap] < wp.int64(0):
                        readout.escape_step[world, trap] = step

    return note_escapes


def make_solo_step(f: Features) -> wp.Kernel:
    """Step for bodies that do not touch: one thread per (world, body), state in registers for all `steps`."""
    free_move = free_move_term(f)
    note_escapes = escape_term(f) if f.escapes else None

    @wp.kernel(module="unique", enable_backward=False)
    def solo_step(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        first_world: int,
        first_step: wp.int64,
        steps: int,
    ):
        world = first_world + wp.tid()
        b = int(0)
        if wp.static(f.bodies > 1):
            b = wp.tid() % wp.static(f.bodies)
            world = first_world + wp.tid() // wp.static(f.bodies)
        pose = Pose(state.position[world, b], wp.quat_identity())
        if wp.static(f.rigid):
            pose.rotation = state.orientation[world, b]
        for i in range(steps):
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            move = free_move(model, control, state, world, b, pose, step, time)
            moved = pose.position + move.linear
            if not finite(moved + move.angular):
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                break
            pose.position = moved
            if wp.static(f.rigid):
                pose.rotation = rotate_by(pose.rotation, move.angular)
            if wp.static(f.escapes):
                note_escapes(model, control, state, readout, world, b, pose, step + wp.int64(1), time + model.time_step)
        state.position[world, b] = pose.position
        if wp.static(f.rigid):
            state.orientation[world, b] = pose.rotation

    return solo_step


def make_world_step(f: Features) -> wp.Kernel:
    """Step for a few bodies that may touch: one thread per world, state in local arrays for all `steps`."""
    free_move = free_move_term(f)
    note_escapes = escape_term(f) if f.escapes else None
    pair_contacts = pair_contacts_term(f) if f.pairs else None
    obstacle_contacts = obstacle_contacts_term(f) if f.obstacles else None
    commanded = commanded_animated if f.moving_traps else commanded_still

    @wp.func
    def move_traps(model: ModelData, control: ControlData, state: StateData, world: int, time: wp.float64):
        for trap in range(model.traps.axis.shape[0]):
            wanted = commanded(model.traps, control, world, trap, time)
            state.trap_position[world, trap] = limited_focus(
                model.traps,
                world,
                trap,
                state.trap_position[world, trap],
                wp.vec3(wanted[0], wanted[1], wanted[2]),
                wp.float32(model.time_step),
            )

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

    @wp.func
    def report_contacts(readout: ReadoutData, world: int, contacts: wp.array(dtype=Contact), count: int):
        bodies = int(wp.static(f.bodies))
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

    @wp.kernel(module="unique", enable_backward=False)
    def world_step(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        first_world: int,
        first_step: wp.int64,
        steps: int,
    ):
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
            contacts = wp.zeros(shape=(wp.static(MAX_CONTACTS),), dtype=Contact)
        good = bool(True)
        for i in range(steps):
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            if wp.static(f.speed_limits):
                move_traps(model, control, state, world, time)
            for b in range(bodies):
                move = free_move(model, control, state, world, b, Pose(position[b], rotation[b]), step, time)
                linear[b] = move.linear
                angular[b] = move.angular
            if wp.static(f.contacts):
                count = find_contacts(model, readout, world, position, rotation, contacts, step, time)
                solve_contacts(contacts, count, linear, angular, wp.static(SWEEPS))
                if i == steps - 1:
                    report_contacts(readout, world, contacts, count)
            for b in range(bodies):
                if not finite(position[b] + linear[b] + angular[b]):
                    raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                if readout.fault[world, b] != 0:
                    good = False
            if not good:
                break
            for b in range(bodies):
                position[b] = position[b] + linear[b]
                if wp.static(f.rigid):
                    rotation[b] = rotate_by(rotation[b], angular[b])
                if wp.static(f.escapes):
                    note_escapes(
                        model,
                        control,
                        state,
                        readout,
                        world,
                        b,
                        Pose(position[b], rotation[b]),
                        step + wp.int64(1),
                        time + model.time_step,
                    )
        for b in range(bodies):
            state.position[world, b] = position[b]
            if wp.static(f.rigid):
                state.orientation[world, b] = rotation[b]

    return world_step
