"""Rotation of rigid bodies: exponential map on unit quaternions."""

import warp as wp


@wp.func
def rotate_by(q: wp.quat, angle: wp.vec3) -> wp.quat:
    """Orientation `q` turned by the rotation vector `angle` [rad, world axes]: normalise(exp(angle/2) ⊗ q).

    sin(θ/2)/θ is replaced by its series below 1e-3 rad, where the quotient would lose digits (error < 1e-14).
    Normalising at every step keeps the norm at 1 to rounding for runs of any length.
    """
    theta2 = wp.dot(angle, angle)
    scale = float(0.0)
    if theta2 < 1.0e-6:
        scale = 0.5 - theta2 / 48.0
    else:
        theta = wp.sqrt(theta2)
        scale = wp.sin(0.5 * theta) / theta
    w = wp.sqrt(wp.max(0.0, 1.0 - scale * scale * theta2))
    # a turn beyond π makes cos(θ/2) negative
    if theta2 > 9.869604401:
        w = wp.cos(0.5 * wp.sqrt(theta2))
    return wp.normalize(wp.quat(scale * angle[0], scale * angle[1], scale * angle[2], w) * q)
