"""Numbers of a world that studies commonly ask for: functions of it at a moment."""

import warp as wp

from otwarp.kernels.core.types import WorldNow


def contact_force(now: WorldNow, body: int = 0) -> float:
    """Sum of the normal forces on a body [pN]; 0 in a scene where nothing can touch."""
    if body >= now.readout.contact_load.shape[1]:
        return 0.0
    return now.readout.contact_load[now.world, body]


def orientation_error(
    now: WorldNow, x: float = 0.0, y: float = 0.0, z: float = 0.0, w: float = 1.0, body: int = 0
) -> float:
    """Angle between a body's orientation and the quaternion (x, y, z, w) [rad]."""
    turn = wp.quat(x, y, z, w) * wp.quat_inverse(now.state.orientation[now.world, body])
    return 2.0 * wp.atan2(wp.length(wp.vec3(turn[0], turn[1], turn[2])), wp.abs(turn[3]))


def first_lost(now: WorldNow) -> float:
    """Index of the trap that was the first to lose its sphere; their number for several in one step, −1 for none."""
    which = float(-1.0)
    earliest = wp.int64(-1)
    traps = now.readout.escape_step.shape[1]
    for trap in range(traps):
        step = now.readout.escape_step[now.world, trap]
        if step >= wp.int64(0) and step == earliest:
            which = float(traps)
        elif step >= wp.int64(0) and (earliest < wp.int64(0) or step < earliest):
            which = float(trap)
            earliest = step
    return which


def place(now: WorldNow, body: int, component: int) -> float:
    """Where the centre of diffusion of a body is along x, y or z (0, 1, 2) [µm]."""
    return now.state.position[now.world, body][component]
