"""Four numbers in one vector: a point, and the one that belongs to it."""

import warp as wp


@wp.func
def beside(point: wp.vec3, number: float) -> wp.vec4:
    """A point [µm] with its power [mW], radius [µm] or distance [µm]."""
    return wp.vec4(point[0], point[1], point[2], number)


@wp.func
def point_of(packed: wp.vec4) -> wp.vec3:
    """The point [µm]: focus or anchor of a trap, centre of a sphere, arm of a contact; of a distance the normal."""
    return wp.vec3(packed[0], packed[1], packed[2])


@wp.func
def power_of(command: wp.vec4) -> float:
    """Power [mW] of a trap, with its focus or anchor."""
    return command[3]


@wp.func
def radius_of(sphere: wp.vec4) -> float:
    """Radius [µm] of a sphere, with its centre."""
    return sphere[3]


@wp.func
def distance_of(hit: wp.vec4) -> float:
    """Signed distance [µm] to an obstacle, with its outward normal."""
    return hit[3]


@wp.func
def curvature_of(bend: wp.vec4) -> float:
    """Curvature [1/µm] of the path of a sphere over an obstacle, with the direction of the ridge."""
    return bend[3]
