"""Where each trap is for a body, how strong it is and whether it reaches: made once a look, or once a launch."""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import beside, point_of, power_of
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.step_constants import RigidConstants
from otwarp.kernels.core.types import Aim, ControlData, ModelData, Pose, StateData, world_row
from otwarp.kernels.optics.trap_command import anchor_of, trap_command_term
from otwarp.kernels.optics.traps import commanded_still


def reach_term(f: Features) -> wp.Function:
    """`(model, world, trap, largest) -> reach` of a trap on spheres up to a radius, from its equilibrium point [µm]."""
    split = any(m.endswith("split") for m in f.trap_models)

    @wp.func
    def reach_of(model: ModelData, world: int, trap: int, largest: float) -> float:
        """Reach [µm] from the equilibrium point: the larger cutoff, scaled to spheres of radius `largest` [µm]."""
        reach = model.traps.cutoff[world_row(model.traps.cutoff.shape[0], world), trap]
        if wp.static(split):
            axial = model.traps.axial_cutoff[world_row(model.traps.axial_cutoff.shape[0], world), trap]
            reach = wp.max(reach, axial)
        if model.traps.law_radius[trap] > 0.0:
            reach *= largest / model.traps.law_radius[trap]
        return reach

    return reach_of


def aim_term(f: Features) -> wp.Function:
    """`(model, control, state, world, b, pose, trap, time) -> Aim`: where a trap is, and whether it reaches a body."""
    trap_command = trap_command_term(f, stage=True)
    reach_of = reach_term(f)

    @wp.func
    def aim(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, pose: Pose, trap: int,
        time: wp.float64,
    ) -> Aim:  # fmt: skip
        """Equilibrium point [µm], power [mW] and squared reach [µm²], which is 0 if the trap is dark or too far."""
        command = trap_command(model, control, state, world, trap, time)
        anchor = anchor_of(model, trap, command)
        if wp.static(f.periodic):
            anchor += image_shift(model.period, anchor - pose.position)
        reach = reach_of(model, world, trap, model.body.largest[b])
        near = reach + model.body.bound[b]
        away2 = wp.length_sq(pose.position - anchor)
        power = power_of(command)
        return Aim(anchor, power, wp.where(away2 < near * near and power > 0.0, reach * reach, 0.0))

    return aim


def rest_aim_term(f: Features) -> wp.Function:
    """`(model, control, world, b, trap) -> Aim` of a trap at rest, or where it was when it began to glide."""
    reach_of = reach_term(f)

    @wp.func
    def rest_aim(model: ModelData, control: ControlData, world: int, b: int, trap: int) -> Aim:
        """Equilibrium point [µm], power [mW] and squared reach [µm²], which is 0 if the trap is dark."""
        command = commanded_still(model.traps, control, world, trap, wp.float64(0.0))
        power = power_of(command)
        reach = reach_of(model, world, trap, model.body.largest[b])
        return Aim(anchor_of(model, trap, command), power, wp.where(power > 0.0, reach * reach, 0.0))

    return rest_aim


@wp.func
def kept_aim(body: RigidConstants, trap: int) -> Aim:
    """Equilibrium point [µm], power [mW] and squared reach [µm²] of a trap at rest, from registers."""
    row = body.aims[trap]
    return Aim(point_of(row), power_of(row), body.reaches[trap])


def kept_aims_term(f: Features) -> wp.Function:
    """`(model, control, world, b, body) -> RigidConstants` with the aims of all traps."""
    rest_aim = rest_aim_term(f)

    @wp.func
    def kept_aims(model: ModelData, control: ControlData, world: int, b: int, body: RigidConstants) -> RigidConstants:
        """Constants with equilibrium points [µm], powers [mW] and squared reaches [µm²] of all traps."""
        for trap in range(wp.static(f.traps)):
            aim = rest_aim(model, control, world, b, trap)
            body.aims[trap] = beside(aim.anchor, aim.power)
            body.reaches[trap] = aim.reach2
        return body

    return kept_aims
