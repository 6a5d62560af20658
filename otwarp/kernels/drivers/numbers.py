"""Numbers of a world that studies commonly ask for: functions of it at a moment."""

import warp as wp

from otwarp.kernels.core.types import WorldNow


def contact_force(now: WorldNow, body: int = 0) -> float:
    """Sum of the normal forces on a body [pN]."""
    return now.readout.contact_load[now.world, body]


def contact_dose(now: WorldNow, body: int = 0) -> float:
    """Sum of the normal forces on a body [pN]; its integral over time is the dose."""
    return now.readout.contact_load[now.world, body]


def orientation_error(
    now: WorldNow, x: float = 0.0, y: float = 0.0, z: float = 0.0, w: float = 1.0, body: int = 0
) -> float:
    """Angle between a body's orientation and the quaternion (x, y, z, w) [rad]."""
    turn = wp.quat(x, y, z, w) * wp.quat_inverse(now.state.orientation[now.world, body])
    return 2.0 * wp.atan2(wp.length(wp.vec3(turn[0], turn[1], turn[2])), wp.abs(turn[3]))
