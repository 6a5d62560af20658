"""What of the simulation's state the servo's chain and the operator's eyes get, a picture at a time: all of it, now.

Spheres and traps as the chain has them, and what a simulated operator makes of a picture. What a camera, an
estimator or a line changes of it is in `perception`.
"""

import warp as wp

from otwarp.kernels.core.types import ControlData, ModelData, StateData, world_row
from otwarp.operators.kernels.types import MindData, SightData, TaskData


@wp.struct
class TwinData:
    """The state as the servo's chain gets it, in float64; S spheres that hands feel."""

    sphere: wp.array2d(dtype=wp.vec3d)  # (W, S) centres [µm]
    trap: wp.array2d(dtype=wp.vec3d)  # (W, T) foci [µm]
    power: wp.array2d(dtype=wp.float64)  # (W, T) [mW]
    body: wp.array(dtype=wp.int32)  # (S) body of each sphere
    offset: wp.array(dtype=wp.vec3)  # (S) where in it [µm]


@wp.func
def focus_of(control: ControlData, state: StateData, world: int, trap: int) -> wp.vec3:
    """Actual focus of a trap that a hand moves [µm]: where its speed limit lets it be, or as commanded."""
    if state.trap_position.shape[1] > 0:
        return state.trap_position[world, trap]
    return control.trap_position[world_row(control.trap_position.shape[0], world), trap]


@wp.func
def distance_of(model: ModelData, control: ControlData, state: StateData, world: int, trap: int) -> float:
    """Distance of the sphere that a trap holds from the trap's equilibrium point [µm], 0 if it holds none."""
    held = model.traps.held_body[trap]
    if held < 0:
        return float(0.0)
    anchor = focus_of(control, state, world, trap) + model.traps.equilibrium[trap] * model.traps.axis[trap]
    offset = wp.quat_rotate(rotation_of(state, world, held), model.traps.held_offset[trap])
    return wp.length(state.position[world, held] + offset - anchor)


@wp.func
def rotation_of(state: StateData, world: int, body: int) -> wp.quat:
    """How a body lies; the identity where no body turns."""
    if state.orientation.shape[1] > 0:
        return state.orientation[world, body]
    return wp.quat_identity()


@wp.kernel(enable_backward=False)
def see(
    model: ModelData, control: ControlData, state: StateData, task: TaskData, mind: MindData,
    done: wp.array(dtype=wp.int32), twin: TwinData, sight: SightData,
):  # fmt: skip
    """Take a picture of each world in motion: spheres and traps for the chain, what is wrong for the operator."""
    world = wp.tid()
    if done[world] != 0:
        return
    for s in range(twin.body.shape[0]):
        body = twin.body[s]
        offset = wp.quat_rotate(rotation_of(state, world, body), twin.offset[s])
        twin.sphere[world, s] = wp.vec3d(state.position[world, body] + offset)
    lag = float(0.0)
    for h in range(task.axes.shape[0]):
        shift, count = wp.vec3d(), int(0)
        for t in range(task.hand_of.shape[0]):
            if task.hand_of[t] == h:
                shift = shift + wp.vec3d(focus_of(control, state, world, t)) - task.start[t]
                lag = wp.max(lag, distance_of(model, control, state, world, t))
                count = count + 1
        mean = shift / (task.gain * wp.float64(count))
        sight.error[world, h] = wp.transpose(task.axes[h]) * mean - mind.wanted[world, h]
    sight.lag[world] = wp.float64(lag)
    for t in range(task.hand_of.shape[0]):
        twin.trap[world, t] = wp.vec3d(focus_of(control, state, world, t))
        row = world_row(control.trap_power.shape[0], world)
        twin.power[world, t] = wp.float64(control.trap_power[row, t])
