"""What the present state says about the traps: forces per trap, sphere and hand, and robot–trap distances.

Measured on demand, not at every step: one thread per trap and per sphere gathers in a fixed order, so no atomics.
"""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import point_of, power_of, radius_of
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.types import ControlData, ModelData, StateData
from otwarp.kernels.core.worlds import time_term
from otwarp.kernels.optics.trap_command import anchor_of, trap_command_term
from otwarp.kernels.optics.traps import trap_force_term


@wp.struct
class TrapReadoutData:
    """Results; S is the number of trapped spheres."""

    position: wp.array2d(dtype=wp.vec3)  # (W, T) actual foci [µm]
    power: wp.array2d(dtype=wp.float32)  # (W, T) [mW]
    force: wp.array2d(dtype=wp.vec3)  # (W, T) force of each trap on all bodies [pN]
    distance: wp.array2d(dtype=wp.float32)  # (W, T) equilibrium point to held sphere [µm], nan if it holds none
    sphere_force: wp.array2d(dtype=wp.vec3)  # (W, S) optical force on each sphere [pN]
    hand_force: wp.array2d(dtype=wp.vec3)  # (W, 2) sum over the traps of the left and the right hand [pN]


def sphere_position_term(f: Features) -> wp.Function:
    """`(model, state, world, b, offset) -> position` of a sphere of a body [µm]."""

    @wp.func
    def sphere_position(model: ModelData, state: StateData, world: int, b: int, offset: wp.vec3) -> wp.vec3:
        """World position [µm] of a point at `offset` [µm] in the body's frame."""
        rotation = wp.quat_identity()
        if wp.static(f.rigid):
            rotation = state.orientation[world, b]
        return state.position[world, b] + wp.quat_rotate(rotation, offset)

    return sphere_position


@wp.kernel(enable_backward=False)
def per_hand(model: ModelData, out: TrapReadoutData):
    """Write the sum of forces [pN] over the traps of one hand, left or right."""
    world, hand = wp.tid()
    total = wp.vec3(0.0)
    for trap in range(model.traps.axis.shape[0]):
        if model.traps.hand[trap] == hand + 1:
            total += out.force[world, trap]
    out.hand_force[world, hand] = total


def force_on_term(f: Features) -> wp.Function:
    """`(model, state, world, b, i, trap, c) -> force` of a trap, c its focus and power, on one sphere [pN]."""
    prepare, trap_force = trap_force_term(f.trap_models)[1:3]
    sphere_position = sphere_position_term(f)

    @wp.func
    def force_on(model: ModelData, state: StateData, world: int, b: int, i: int, trap: int, c: wp.vec4) -> wp.vec3:
        """Force [pN] in world axes of one trap, its focus and power in c, on trapped sphere i of body b."""
        s = model.body.trapped[i]
        x = sphere_position(model, state, world, b, point_of(s))
        law = prepare(model.traps, world, trap, radius_of(s), model.body.trapped_kind[i])
        away = x - anchor_of(model, trap, c)
        if wp.static(f.periodic):
            away = nearest(model.period, away)
        return power_of(c) * trap_force(model.traps, law, away)

    return force_on


def make_trap_readout(f: Features) -> tuple[wp.Kernel, wp.Kernel]:
    """Kernels over (world, trap or body, the traps first) and over (world, hand), to be launched in this order."""
    trap_command, time_of = trap_command_term(f), time_term(f)
    sphere_position, force_on = sphere_position_term(f), force_on_term(f)

    @wp.kernel(module="unique", enable_backward=False)
    def per_trap_and_body(
        model: ModelData, control: ControlData, state: StateData, out: TrapReadoutData, time: wp.float64
    ):
        """Sum the forces of one trap on all bodies, or of all traps on the spheres of one body.

        A trap's thread writes its focus [µm], power [mW], total force [pN] and distance to the held sphere [µm], a
        body's the optical force [pN] in world axes on each of its trapped spheres.
        """
        world, item = wp.tid()
        traps = model.traps.axis.shape[0]
        of_trap = item < traps
        first_trap = wp.where(of_trap, item, 0)
        last_trap = wp.where(of_trap, item + 1, traps)
        first_body = wp.where(of_trap, 0, item - traps)
        last_body = wp.where(of_trap, model.bodies, item - traps + 1)
        if not of_trap:
            for i in range(model.body.trapped_start[first_body], model.body.trapped_start[last_body]):
                out.sphere_force[world, i] = wp.vec3(0.0)
        # one sum for both, so that the law of force is compiled once
        for trap in range(first_trap, last_trap):
            c = trap_command(model, control, state, world, trap, time_of(model, world, time))
            total = wp.vec3(0.0)
            for b in range(first_body, last_body):
                for i in range(model.body.trapped_start[b], model.body.trapped_start[b + 1]):
                    force = force_on(model, state, world, b, i, trap, c)
                    total += force
                    if not of_trap:
                        out.sphere_force[world, i] += force
            if of_trap:
                out.position[world, trap] = point_of(c)
                out.power[world, trap] = power_of(c)
                out.force[world, trap] = total
                distance = wp.float32(wp.nan)
                held = model.traps.held_body[trap]
                if held >= 0:
                    place = sphere_position(model, state, world, held, model.traps.held_offset[trap])
                    away = place - anchor_of(model, trap, c)
                    if wp.static(f.periodic):
                        away = nearest(model.period, away)
                    distance = wp.length(away)
                out.distance[world, trap] = distance

    return per_trap_and_body, per_hand
