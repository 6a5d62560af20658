"""What the present state says about the traps: forces per trap, sphere and hand, and robot–trap distances.

Measured on demand, not at every step: one thread per trap and per sphere gathers in a fixed order, so no atomics.
"""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.types import ControlData, ModelData, StateData
from otwarp.kernels.core.worlds import time_term
from otwarp.kernels.optics.trap_wrench import anchor_of, trap_command_term
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


def make_trap_readout(f: Features) -> tuple[wp.Kernel, wp.Kernel, wp.Kernel]:
    """Kernels over (world, trap), (world, sphere) and (world, hand), to be launched in this order."""
    trap_command = trap_command_term(f)
    prepare, trap_force = trap_force_term(f.trap_models)[1:3]
    sphere_position = sphere_position_term(f)
    time_of = time_term(f)

    @wp.func
    def force_on(model: ModelData, state: StateData, world: int, b: int, i: int, trap: int, c: wp.vec4) -> wp.vec3:
        """Force [pN] in world axes of one trap, its focus and power in c, on trapped sphere i of body b."""
        s = model.body.trapped[i]
        x = sphere_position(model, state, world, b, wp.vec3(s[0], s[1], s[2]))
        law = prepare(model.traps, world, trap, s[3], model.body.trapped_kind[i])
        away = x - anchor_of(model, trap, c)
        if wp.static(f.periodic):
            away = nearest(model.period, away)
        return c[3] * trap_force(model.traps, law, away)

    @wp.kernel(module="unique", enable_backward=False)
    def per_trap(model: ModelData, control: ControlData, state: StateData, out: TrapReadoutData, time: wp.float64):
        """Write focus [µm], power [mW], total force [pN] and distance to the held sphere [µm] of one trap."""
        world, trap = wp.tid()
        c = trap_command(model, control, state, world, trap, time_of(model, world, time))
        out.position[world, trap] = wp.vec3(c[0], c[1], c[2])
        out.power[world, trap] = c[3]
        total = wp.vec3(0.0)
        for b in range(model.bodies):
            for i in range(model.body.trapped_start[b], model.body.trapped_start[b + 1]):
                total += force_on(model, state, world, b, i, trap, c)
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

    @wp.kernel(module="unique", enable_backward=False)
    def per_sphere(model: ModelData, control: ControlData, state: StateData, out: TrapReadoutData, time: wp.float64):
        """Write the optical force [pN] in world axes on each trapped sphere of one body."""
        world, b = wp.tid()
        for i in range(model.body.trapped_start[b], model.body.trapped_start[b + 1]):
            total = wp.vec3(0.0)
            for trap in range(model.traps.axis.shape[0]):
                c = trap_command(model, control, state, world, trap, time_of(model, world, time))
                total += force_on(model, state, world, b, i, trap, c)
            out.sphere_force[world, i] = total

    @wp.kernel(module="unique", enable_backward=False)
    def per_hand(model: ModelData, out: TrapReadoutData):
        """Write the sum of forces [pN] over the traps of one hand, left or right."""
        world, hand = wp.tid()
        total = wp.vec3(0.0)
        for trap in range(model.traps.axis.shape[0]):
            if model.traps.hand[trap] == hand + 1:
                total += out.force[world, trap]
        out.hand_force[world, hand] = total

    return per_trap, per_sphere, per_hand
