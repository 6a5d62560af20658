"""Courses: how a simulated operator's submovement goes on in time, and where a path is."""

import warp as wp


@wp.func
def minimum_jerk(x: wp.float64) -> wp.float64:
    """Part of a displacement that is made after the part x of its duration: 10x³ − 15x⁴ + 6x⁵, 0 before and 1 after.

    Flash and Hogan 1985, doi:10.1523/JNEUROSCI.05-07-01688.1985.
    """
    u = wp.clamp(x, wp.float64(0.0), wp.float64(1.0))
    return u * u * u * (wp.float64(10.0) + u * (wp.float64(6.0) * u - wp.float64(15.0)))


@wp.func
def path_at(path: wp.array2d(dtype=wp.vec3d), hand: int, spacing: wp.float64, time: wp.float64) -> wp.vec3d:
    """Way of a hand from its start at a time of its path [m]: linear between samples, held outside them."""
    last = path.shape[1] - 1
    at = wp.clamp(time / spacing, wp.float64(0.0), wp.float64(last))
    low = wp.min(int(at), wp.max(last - 1, 0))
    high = wp.min(low + 1, last)
    w = at - wp.float64(low)
    return (wp.float64(1.0) - w) * path[hand, low] + w * path[hand, high]
