"""Escape detection: the first step at which a trap no longer reaches the sphere it holds."""

import warp as wp

from otwarp.kernels.body import trap_command_term
from otwarp.kernels.features import Features
from otwarp.kernels.types import ControlData, ModelData, Pose, ReadoutData, StateData, world_row


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
        """Compare the held sphere's distance with the trap's reach."""
        for trap in range(model.traps.axis.shape[0]):
            if model.traps.held_body[trap] == b:
                command = trap_command(model, control, state, world, trap, time)
                anchor = wp.vec3(command[0], command[1], command[2])
                anchor += model.traps.equilibrium[trap] * model.traps.axis[trap]
                held = pose.position + wp.quat_rotate(pose.rotation, model.traps.held_offset[trap])
                away = held - anchor
                reach = model.traps.held_range[world_row(model.traps.held_range.shape[0], world), trap]
                # a dark trap holds nothing that could escape
                if command[3] > 0.0 and wp.length_sq(away) > reach * reach:
                    if readout.escape_step[world, trap] < wp.int64(0):
                        readout.escape_step[world, trap] = step

    return note_escapes
