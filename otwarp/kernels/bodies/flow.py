"""Background flow: velocity and angular velocity with which a sphere that nothing holds goes along with the liquid.

Common signature `(flow, world, point, radius) -> Move` per second (µm/s, rad/s), world axes. By Faxén's laws the sphere
has the velocity u + a²/6 ∇²u at its centre, which is the mean of u over its surface, and turns with half the curl;
with the radius 0 these are of the undisturbed liquid. Terms of higher order vanish in all flows here.

Source: H. Faxén 1922, doi:10.1002/andp.19223731003; S. Kim, S. J. Karrila, Microhydrodynamics, 1991, section 3.3.
"""

import warp as wp

from otwarp.kernels.core.types import FlowData, Move, world_row


@wp.func
def uniform_flow(flow: FlowData, world: int, point: wp.vec3, radius: float) -> Move:
    """u = U x̂ [µm/s] of the flow's frame, without rotation; the radius [µm] makes no difference."""
    speed = flow.speed[world_row(flow.speed.shape[0], world)]
    return Move(wp.quat_rotate(flow.rotation, wp.vec3(speed, 0.0, 0.0)), wp.vec3(0.0))


@wp.func
def shear_flow(flow: FlowData, world: int, point: wp.vec3, radius: float) -> Move:
    """u = γ̇ z x̂ [µm/s], half curl ½γ̇ ŷ [rad/s], in the flow's frame; the radius [µm] makes no difference."""
    rate = flow.shear_rate[world_row(flow.shear_rate.shape[0], world)]
    z = wp.quat_rotate_inv(flow.rotation, point - flow.origin)[2]
    return Move(
        wp.quat_rotate(flow.rotation, wp.vec3(rate * z, 0.0, 0.0)),
        wp.quat_rotate(flow.rotation, wp.vec3(0.0, 0.5 * rate, 0.0)),
    )


@wp.func
def poiseuille_flow(flow: FlowData, world: int, point: wp.vec3, radius: float) -> Move:
    """Mean of u = U (1 − (z/h)²) x̂ [µm/s] over a sphere of `radius` [µm], half curl −U z/h² ŷ [rad/s].

    The plates are at z = ±h; outside them all is 0. ∇²u = −2U/h² x̂.
    """
    speed = flow.speed[world_row(flow.speed.shape[0], world)]
    relative = wp.quat_rotate_inv(flow.rotation, point - flow.origin)[2] / flow.half_height
    linear = float(0.0)
    angular = float(0.0)
    if wp.abs(relative) < 1.0:
        wide = radius / flow.half_height
        linear = speed * (1.0 - relative * relative - wide * wide / 3.0)
        angular = -speed * relative / flow.half_height
    return Move(
        wp.quat_rotate(flow.rotation, wp.vec3(linear, 0.0, 0.0)),
        wp.quat_rotate(flow.rotation, wp.vec3(0.0, angular, 0.0)),
    )


FLOW_TERMS: dict[str, wp.Function] = {"uniform": uniform_flow, "shear": shear_flow, "poiseuille": poiseuille_flow}
"""Flow profiles by name."""
