"""Roots and reciprocals in float64, rounded correctly: as `otwarp.kernels.core.roots`."""

import warp as wp


@wp.func
def square_root(x: wp.float64) -> wp.float64:
    """√x of x ≥ 0, rounded correctly."""
    return wp.sqrt(x)


@wp.func
def reciprocal_root(x: wp.float64) -> wp.float64:
    """1/√x of x > 0 by a root and a division, each rounded correctly; inf for x = 0."""
    return wp.float64(1.0) / wp.sqrt(x)


@wp.func
def length_of(v: wp.vec3d) -> wp.float64:
    """|v| ≥ 0, in the units of v, rounded as its square is."""
    return wp.length(v)


@wp.func
def direction_of(v: wp.vec3d) -> wp.vec3d:
    """v/|v| [1]; 0 of a vector without length."""
    return wp.normalize(v)


@wp.func
def cube_root(x: wp.float64) -> wp.float64:
    """∛x of x > 0, as the platform's cbrt has it: relative error at most 2⁻⁵⁰."""
    return wp.cbrt(x)


@wp.func
def reciprocal(x: wp.float64) -> wp.float64:
    """1/x, rounded correctly; inf for x = 0."""
    return wp.float64(1.0) / x
