"""Where a trap is: as commanded, or as far as its speed limit let it come."""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.keyframes import Piece
from otwarp.kernels.core.packed import beside, point_of, power_of
from otwarp.kernels.core.step_constants import Glide, TrapConstants
from otwarp.kernels.core.types import ControlData, ModelData, StateData, TrapData, world_row
from otwarp.kernels.optics.traps import (
    anchored,
    commanded_animated,
    commanded_by_step,
    commanded_staged,
    commanded_still,
    glide_of,
    glided,
    limited_focus,
    piece_terms,
)


@wp.func
def as_far(model: ModelData, state: StateData, world: int, trap: int, command: wp.vec4) -> wp.vec4:
    """Focus [µm] as far as the speed limit of the trap, if it has one, let it come, and power [mW]."""
    reached = command
    if model.traps.speed_limit[world_row(model.traps.speed_limit.shape[0], world), trap] < wp.inf:
        p = state.trap_position[world, trap]
        reached = beside(p, power_of(command))
    return reached


def commanded_term(f: Features, *, stage: bool = False) -> wp.Function:
    """`(traps, control, world, trap, time) -> vec4(focus, power)`: where the trap is to be; `stage` as below."""
    sampled = commanded_animated if f.moving_traps else commanded_still
    if f.moving_traps and f.looks_once:
        sampled = commanded_by_step
    if f.leaps and stage:
        sampled = commanded_staged

    @wp.func
    def commanded_gliding(traps: TrapData, control: ControlData, world: int, trap: int, time: wp.float64) -> wp.vec4:
        """Commanded focus [µm] and power [mW] of a trap whose focus goes on at the velocity that is commanded."""
        return glided(glide_of(control, world, trap), sampled(traps, control, world, trap, time), time)

    return commanded_gliding if f.gliding_traps else sampled


def trap_command_term(f: Features, *, stage: bool = False) -> wp.Function:
    """`(model, control, state, world, trap, time) -> vec4(focus, power)`: where the trap is now.

    With `stage` where it counts to be in the stage of a step at `time`.
    """
    commanded = commanded_term(f, stage=stage)

    @wp.func
    def trap_command(
        model: ModelData, control: ControlData, state: StateData, world: int, trap: int, time: wp.float64
    ) -> wp.vec4:
        """Focus [µm] as commanded, or as far as the speed limit let it come, and power [mW]."""
        command = commanded(model.traps, control, world, trap, time)
        if wp.static(f.speed_limits):
            command = as_far(model, state, world, trap, command)
        return command

    return trap_command


def piece_command_term(f: Features) -> wp.Function:
    """`(model, control, state, world, trap, piece, glide, still, time) -> vec4(focus, power)` by a piece."""
    _, commanded = piece_terms(f)

    @wp.func
    def piece_command(
        model: ModelData, control: ControlData, state: StateData, world: int, trap: int, piece: Piece, glide: Glide,
        still: wp.vec4, time: wp.float64,
    ) -> wp.vec4:  # fmt: skip
        """Focus [µm] as commanded, or as far as the speed limit let it come, and power [mW]; `still` unfollowed."""
        command = commanded(model.traps, control, trap, piece, still, time)
        if wp.static(f.gliding_traps):
            command = glided(glide, command, time)
        if wp.static(f.speed_limits):
            command = as_far(model, state, world, trap, command)
        return command

    return piece_command


def move_trap_term(f: Features) -> wp.Function:
    """`(model, control, state, world, trap, time)`: move a focus from `time` one step on, as fast as it may.

    It heads for where the command is at the end of the step.
    """
    commanded = commanded_term(f)

    @wp.func
    def move_trap(model: ModelData, control: ControlData, state: StateData, world: int, trap: int, time: wp.float64):
        """Write the new focus [µm] to `state.trap_position`."""
        wanted = commanded(model.traps, control, world, trap, time + model.time_step)
        now = state.trap_position[world, trap]
        dt = wp.float32(model.time_step)
        goal = point_of(wanted)
        state.trap_position[world, trap] = limited_focus(model.traps, world, trap, now, goal, dt)

    return move_trap


def kept_anchor_term(f: Features) -> wp.Function:
    """`(law, kept, glide, time) -> vec4(equilibrium point, power)` from what a launch has kept of a trap."""

    @wp.func
    def still(law: TrapConstants, kept: wp.vec4, glide: Glide, time: wp.float64) -> wp.vec4:
        """Equilibrium point [µm] and power [mW] of a trap that stays, which are kept."""
        return kept

    @wp.func
    def gliding(law: TrapConstants, kept: wp.vec4, glide: Glide, time: wp.float64) -> wp.vec4:
        """Equilibrium point [µm] and power [mW] of a trap that glides, of which the command is kept."""
        return anchored(law, glided(glide, kept, time))

    return gliding if f.gliding_traps else still


@wp.func
def anchor_of(model: ModelData, trap: int, command: wp.vec4) -> wp.vec3:
    """Equilibrium point of a trap whose focus is commanded to be there [µm]."""
    return point_of(command) + model.traps.equilibrium[trap] * model.traps.axis[trap]
