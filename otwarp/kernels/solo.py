"""The `solo` driver: bodies that cannot touch, one thread per (world, body), state in registers for many steps."""

import warp as wp

from otwarp.kernels.body import free_move_term
from otwarp.kernels.escapes import escape_term
from otwarp.kernels.faults import Fault, finite, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.rotation import rotate_by
from otwarp.kernels.types import ControlData, ModelData, Pose, ReadoutData, StateData


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
        """Take `steps` steps from `first_step` for the worlds from `first_world` on."""
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
