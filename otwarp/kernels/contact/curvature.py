"""Relative curvature of a sphere and the obstacle that it touches: the radius R of Hertz's law.

Two surfaces of principal curvatures along the same axes touch like a sphere on a plane whose curvatures A and B are the
sums of theirs; where A = B, Hertz's law holds with R = 1/A. Where they differ, on the sides of cylinders and capsules,
the area of contact is an ellipse, and R = 1/√(AB) stands for it (K. L. Johnson, Contact Mechanics, 1985, §4.2): the
force is then too small by 1 % on a cylinder of the sphere's radius, by 5 % on one of a quarter of it and by 11 % on one
of a ninth. Planes, boxes and meshes count as flat.
"""

import warp as wp

from otwarp.kernels.contact.obstacles import SHAPES
from otwarp.kernels.core.types import ObstacleData

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
