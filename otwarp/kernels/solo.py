"""The `solo` driver: bodies that cannot touch, one thread per (world, body), state in registers for many steps."""

import warp as wp

from otwarp.kernels.body import FEW_TRAPS, bead_constants_term, bead_move_term, free_move_term
from otwarp.kernels.escapes import escape_term
from otwarp.kernels.faults import Fault, finite, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.types import (
    ControlData,
    ModelData,
    Pose,
    ReadoutData,
    StateData,
    TrapConstants,
    TrapData,
    world_row,
)


def make_solo_step(f: Features) -> wp.Kernel:
    """Step for bodies that do not touch; lone spheres have a kernel of their own that keeps constants in registers."""
    return make_body_step(f) if f.rigid else make_bead_step(f)


@wp.func
def watched_range(traps: TrapData, readout: ReadoutData, world: int, b: int, trap: int) -> float:
    """Squared distance at which the sphere that a trap holds has escaped [µm²]; inf if this is not it, or it has."""
    reach = traps.held_range[world_row(traps.held_range.shape[0], world), trap]
    if traps.held_body[trap] != b or readout.escape_step[world, trap] >= wp.int64(0):
        reach = wp.inf
    return reach * reach


@wp.func
def escaped(law: TrapConstants, command: wp.vec4, position: wp.vec3, range2: float) -> bool:
    """Whether a sphere is out of the range of a trap that shines."""
    # the same displacement as the force of the step needs, so that it is computed once
    away = position - (wp.vec3(command[0], command[1], command[2]) + law.equilibrium * law.axis)
    return wp.length_sq(away) > range2 and command[3] > 0.0


def make_bead_step(f: Features) -> wp.Kernel:
    """Step for lone spheres: whatever does not change over a launch is read once."""
    bead_constants = bead_constants_term(f)
    bead_move = bead_move_term(f)
    watch = f.escapes and f.still_traps and f.traps <= FEW_TRAPS
    note_escapes = escape_term(f) if f.escapes and not watch else None

    # one thread per body: Warp's loop over more bodies than threads would cost registers and 5 % of the speed
    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options={"fast_math": f.fast_math})
    def bead_step(
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
        b = int(0)
        if wp.static(f.bodies > 1):
            b = wp.tid() % wp.static(f.bodies)
            world = first_world + wp.tid() // wp.static(f.bodies)
        position = state.position[world, b]
        bead = bead_constants(model, control, world, b)
        # steps of this launch after which the sphere held by the first or second trap was out of range; a sphere that
        # starts there escapes with the first step
        first_escape = int(-1)
        second_escape = int(-1)
        first_range = float(wp.inf)
        second_range = float(wp.inf)
        if wp.static(watch):
            if bead.trapped != 0:
                first_range = watched_range(model.traps, readout, world, b, 0)
                if wp.static(f.traps == FEW_TRAPS):
                    second_range = watched_range(model.traps, readout, world, b, 1)
        taken = int(0)
        for i in range(steps):
            if wp.static(watch):
                if escaped(bead.first, bead.first_command, position, first_range):
                    first_escape = i
                    first_range = float(wp.inf)
                if wp.static(f.traps == FEW_TRAPS):
                    if escaped(bead.second, bead.second_command, position, second_range):
                        second_escape = i
                        second_range = float(wp.inf)
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            moved = position + bead_move(model, control, state, bead, world, b, position, step, time)
            if not finite(moved):
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                break
            position = moved
            taken = i + 1
            if wp.static(f.escapes and not watch):
                pose = Pose(position, wp.quat_identity())
                note_escapes(model, control, state, readout, world, b, pose, step + wp.int64(1), time + model.time_step)
        state.position[world, b] = position
        if wp.static(watch):
            if escaped(bead.first, bead.first_command, position, first_range):
                first_escape = taken
            if first_escape >= 0:
                readout.escape_step[world, 0] = first_step + wp.int64(wp.max(first_escape, 1))
        if wp.static(watch and f.traps == FEW_TRAPS):
            if escaped(bead.second, bead.second_command, position, second_range):
                second_escape = taken
            if second_escape >= 0:
                readout.escape_step[world, 1] = first_step + wp.int64(wp.max(second_escape, 1))

    return bead_step


def make_body_step(f: Features) -> wp.Kernel:
    """Step for bodies of which some rotate."""
    free_move = free_move_term(f)
    note_escapes = escape_term(f) if f.escapes else None

    # one thread per body: Warp's loop over more bodies than threads would cost registers and 5 % of the speed
    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options={"fast_math": f.fast_math})
    def body_step(
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
        b = int(0)
        if wp.static(f.bodies > 1):
            b = wp.tid() % wp.static(f.bodies)
            world = first_world + wp.tid() // wp.static(f.bodies)
        pose = Pose(state.position[world, b], state.orientation[world, b])
        for i in range(steps):
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            move = free_move(model, control, state, world, b, pose, step, time)
            moved = pose.position + move.linear
            if not finite(moved + move.angular):
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                break
            pose.position = moved
            pose.rotation = rotate_by(pose.rotation, move.angular)
            if wp.static(f.escapes):
                note_escapes(model, control, state, readout, world, b, pose, step + wp.int64(1), time + model.time_step)
        state.position[world, b] = pose.position
        state.orientation[world, b] = pose.rotation

    return body_step
