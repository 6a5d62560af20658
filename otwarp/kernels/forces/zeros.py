"""Where a sum of forces starts."""

import warp as wp

from otwarp.kernels.core.types import Wrench, mat66


@wp.func
def no_force() -> wp.vec3:
    """No force on a sphere [pN]."""
    return wp.vec3(0.0)


@wp.func
def no_stiffness() -> wp.mat33:
    """No stiffness against displacement of a sphere [pN/µm]."""
    return wp.mat33(0.0)


@wp.func
def no_wrench() -> Wrench:
    """No force [pN] and no torque [pN·µm] on a rigid body."""
    return Wrench(wp.vec3(0.0), wp.vec3(0.0))


@wp.func
def no_body_stiffness() -> mat66:
    """No stiffness of a rigid body against displacement and rotation [pN/µm, pN, pN·µm]."""
    return mat66(0.0)


ZEROS = {"force": (wp.vec3, no_force), "stiffness": (wp.mat33, no_stiffness)}
"""Type and zero of what is summed on a sphere."""
