"""Relative curvature of a sphere and the obstacle that it touches: the radius R of Hertz's law.

Two surfaces of principal curvatures along the same axes touch like a sphere on a plane whose curvatures A and B are the
sums of theirs; where A = B, Hertz's law holds with R = 1/A. Where they differ, on the sides of cylinders and capsules,
the area of contact is an ellipse, and R = 1/√(AB) stands for it (K. L. Johnson, Contact Mechanics, 1985, §4.2): the
force is then too small by 1 % on a cylinder of the sphere's radius, by 5 % on one of a quarter of it and by 11 % on one
of a ninth. Planes, boxes and meshes count as flat.

The path of the sphere's centre along the obstacle is another one: it is curved about edges and corners, too.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.obstacles import SHAPES
from otwarp.kernels.core.types import ObstacleData

LEVEL = wp.constant(0.1)
"""Cosine to the normal up to which a rod touches with its side, as `segments.VALLEY_SLOPE`."""

_BOX = wp.constant(SHAPES["box"][0])
_BALL = wp.constant(SHAPES["sphere"][0])
_CYLINDER = wp.constant(SHAPES["cylinder"][0])
_CAPSULE = wp.constant(SHAPES["capsule"][0])


def relative_radius_term(shapes: tuple[str, ...]) -> wp.Function:
    """`(obstacles, o, point, outward, radius) -> R` of a sphere of that radius [µm] at `point`.

    `point` is in the obstacle's frame, `outward` the normal there.

    Args:
        shapes: Those that the scene has.
    """

    @wp.func
    def flat(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> float:
        """R [µm] before flat obstacles: the radius of the sphere."""
        return radius

    @wp.func
    def curved(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> float:
        """R [µm] from the curvature of the part that is touched: cap, side or face."""
        shape = obstacles.shape[o]
        size = obstacles.size[o]
        ratio = float(0.0)
        if size[0] > 0.0:
            ratio = radius / size[0]
        relative = radius
        if shape == _BALL or (shape == _CAPSULE and wp.abs(point[2]) > size[1]):
            relative = radius / (1.0 + ratio)
        elif shape == _CAPSULE or (shape == _CYLINDER and outward[2] == 0.0):
            relative = radius / wp.sqrt(1.0 + ratio)
        return relative

    return curved if {"sphere", "cylinder", "capsule"} & set(shapes) else flat


def path_bend_term(shapes: tuple[str, ...]) -> wp.Function:
    """`(obstacles, o, point, outward, radius) -> vec4`: how the centre of a sphere moves along an obstacle.

    `point` is that centre in the obstacle's frame, `outward` the normal there; the result is ridge and
    curvature [1/µm] of the surface that centres of touching spheres lie on, see `Contact`. Meshes count as flat, and
    the rim of a cylinder as straight.

    Args:
        shapes: Those that the scene has.
    """

    @wp.func
    def straight(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> wp.vec4:
        """No ridge and no curvature [1/µm]: centres move along flat obstacles on straight ways."""
        return wp.vec4(0.0)

    @wp.func
    def bent(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> wp.vec4:
        """Ridge and curvature [1/µm] about a centre, an axis, an edge, a rim or a corner."""
        shape = obstacles.shape[o]
        size = obstacles.size[o]
        ridge = wp.vec3(0.0)
        curvature = float(0.0)
        if shape == _BALL or (shape == _CAPSULE and wp.abs(point[2]) > size[1]):
            curvature = 1.0 / (size[0] + radius)
        elif shape == _CAPSULE or (shape == _CYLINDER and outward[2] == 0.0):
            curvature = 1.0 / (size[0] + radius)
            ridge = wp.vec3(0.0, 0.0, 1.0)
        elif shape == _CYLINDER and wp.abs(outward[2]) < 1.0:
            curvature = 1.0 / radius
            ridge = wp.normalize(wp.vec3(-point[1], point[0], 0.0))
        elif shape == _BOX:
            faces = int(0)
            for axis in range(3):
                faces += wp.where(outward[axis] != 0.0, 1, 0)
            if faces > 1:
                curvature = 1.0 / radius
            if faces == 2:
                ridge = wp.vec3(
                    wp.where(outward[0] == 0.0, 1.0, 0.0),
                    wp.where(outward[1] == 0.0, 1.0, 0.0),
                    wp.where(outward[2] == 0.0, 1.0, 0.0),
                )
        return wp.vec4(ridge[0], ridge[1], ridge[2], curvature)

    return bent if set(shapes) - {"plane", "mesh"} else straight


@wp.func
def beside_rod(c: Contact, half: wp.vec3) -> Contact:
    """The contact of a rod with `half` of its axis [µm]: where its side touches it is flat along the axis.

    Two sides that cross touch in one point wherever they are shifted to.
    """
    length = wp.length(half)
    if length > 0.0:
        axis = half / length
        if wp.abs(wp.dot(axis, c.normal)) <= LEVEL:
            if wp.length_sq(c.ridge) == 0.0:
                c.ridge = wp.normalize(axis - wp.dot(axis, c.normal) * c.normal)
            elif wp.length(wp.cross(c.ridge, axis)) > LEVEL:
                c.curvature = 0.0
    return c
