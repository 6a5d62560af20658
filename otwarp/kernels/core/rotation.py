"""Rotation of rigid bodies: exponential map on unit quaternions."""

import warp as wp

from otwarp.kernels.core.rounding import SMALL_ANGLE2


@wp.func
def rotate_by(q: wp.quat, angle: wp.vec3) -> wp.quat:
    """Orientation `q` turned by the rotation vector `angle` [rad, world axes]: normalise(exp(angle/2) ⊗ q).

    Up to a small angle (0.3 rad in float32) sin(θ/2)/θ and cos(θ/2) come from their series. Normalising at every step
    keeps the norm at 1 to rounding for runs of any length; so near to 1 one step of Newton's method for 1/√ is exact.
    """
    theta2 = wp.dot(angle, angle)
    scale = 0.5 + theta2 * (-1.0 / 48.0 + theta2 * (1.0 / 3840.0))
    w = 1.0 + theta2 * (-0.125 + theta2 * (1.0 / 384.0))
    if theta2 > SMALL_ANGLE2:
        theta = wp.sqrt(theta2)
        scale = wp.sin(0.5 * theta) / theta
        w = wp.cos(0.5 * theta)
    turned = wp.quat(scale * angle[0], scale * angle[1], scale * angle[2], w) * q
    norm2 = wp.dot(turned, turned)
    scale = 1.5 - 0.5 * norm2
    if wp.abs(norm2 - 1.0) > 1.0e-3:
        scale = 1.0 / wp.sqrt(norm2)
    return scale * turned


@wp.func
def rotation_matrix(q: wp.quat) -> wp.mat33:
    """Matrix of a unit quaternion: 12 products in place of the 75 of Warp's, which turns the axes one by one."""
    x2 = q[0] + q[0]
    y2 = q[1] + q[1]
    z2 = q[2] + q[2]
    xx = q[0] * x2
    xy = q[0] * y2
    xz = q[0] * z2
    yy = q[1] * y2
    yz = q[1] * z2
    zz = q[2] * z2
    wx = q[3] * x2
    wy = q[3] * y2
    wz = q[3] * z2
    return wp.mat33(
        1.0 - (yy + zz), xy - wz, xz + wy, xy + wz, 1.0 - (xx + zz), yz - wx, xz - wy, yz + wx, 1.0 - (xx + yy)
    )
