"""A simulated operator's passive arm: with the device a mass on a spring and a damper about where it wants to be."""

import warp as wp


@wp.func
def deviate(
    turn: wp.vec4d, stiffness: wp.float64, force: wp.vec3d, away: wp.vec3d, velocity: wp.vec3d
) -> tuple[wp.vec3d, wp.vec3d]:
    """Deviation [m] and its velocity [m/s] a period later: m ÿ + b ẏ + k y = F for a force [N] that is held meanwhile.

    Exact: `turn` is the exponential of the period's matrix, which acts on the deviation from rest F/k.
    """
    rest = force / stiffness
    y = away - rest
    return rest + turn[0] * y + turn[1] * velocity, turn[2] * y + turn[3] * velocity
