"""Background flow: velocity and angular velocity (half the curl) of the undisturbed liquid at a point.

Common signature `(flow, world, point) -> Move` per second (µm/s, rad/s), world axes.
"""

import warp as wp

from otwarp.kernels.core.types import FlowData, Move, world_row


@wp.func
def uniform_flow(flow: FlowData, world: int, point: wp.vec3) -> Move:
    """u = U x̂ [µm/s] of the flow's frame, without rotation."""
    speed = flow.speed[world_row(flow.speed.shape[0], world)]
    return Move(wp.quat_rotate(flow.rotation, wp.vec3(speed, 0.0, 0.0)), wp.vec3(0.0))


@wp.func
def shear_flow(flow: FlowData, world: int, point: wp.vec3) -> Move:
    """u = γ̇ z x̂ [µm/s], half curl ½γ̇ ŷ [rad/s], in the flow's frame."""
    rate = flow.shear_rate[world_row(flow.shear_rate.shape[0], world)]
    z = wp.quat_rotate_inv(flow.rotation, point - flow.origin)[2]
    return Move(
        wp.quat_rotate(flow.rotation, wp.vec3(rate * z, 0.0, 0.0)),
        wp.quat_rotate(flow.rotation, wp.vec3(0.0, 0.5 * rate, 0.0)),
    )


@wp.func
def poiseuille_flow(flow: FlowData, world: int, point: wp.vec3) -> Move:
    """u = U (1 − (z/h)²) x̂ [µm/s] between plates at z = ±h, half curl −U z/h² ŷ [rad/s]; 0 outside the plates."""
    speed = flow.speed[world_row(flow.speed.shape[0], world)]
    relative = wp.quat_rotate_inv(flow.rotation, point - flow.origin)[2] / flow.half_height
    linear = float(0.0)
    angular = float(0.0)
    if wp.abs(relative) < 1.0:
        linear = speed * (1.0 - relative * relative)
        angular = -speed * relative / flow.half_height
    return Move(
        wp.quat_rotate(flow.rotation, wp.vec3(linear, 0.0, 0.0)),
        wp.quat_rotate(flow.rotation, wp.vec3(0.0, angular, 0.0)),
    )


FLOW_TERMS: dict[str, wp.Function] = {"uniform": uniform_flow, "shear": shear_flow, "poiseuille": poiseuille_flow}
"""Flow profiles by name."""
