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


@wp.func
def flat_radius(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> float:
    """R [µm] before flat obstacles: the radius of the sphere."""
    return radius


@wp.func
def ball_radius(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> float:
    """R [µm] before a ball: the inverse of the sum of both curvatures."""
    return radius / (1.0 + radius / obstacles.size[o][0])


@wp.func
def side_radius(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> float:
    """R [µm] before the side of a cylinder or capsule: 1/√(AB)."""
    return radius / wp.sqrt(1.0 + radius / obstacles.size[o][0])


@wp.func
def cylinder_radius(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> float:
    """R [µm] before a cylinder: of its side, or of a flat cap."""
    relative = radius
    if outward[2] == 0.0:
        relative = side_radius(obstacles, o, point, outward, radius)
    return relative


@wp.func
def capsule_radius(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> float:
    """R [µm] before a capsule: of its side, or of a round cap."""
    relative = side_radius(obstacles, o, point, outward, radius)
    if wp.abs(point[2]) > obstacles.size[o][1]:
        relative = ball_radius(obstacles, o, point, outward, radius)
    return relative


@wp.func
def straight(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> wp.vec4:
    """No ridge and no curvature [1/µm]: centres move along flat obstacles on straight ways."""
    return wp.vec4(0.0)


@wp.func
def ball_bend(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> wp.vec4:
    """Curvature [1/µm] about the centre of a ball."""
    return wp.vec4(0.0, 0.0, 0.0, 1.0 / (obstacles.size[o][0] + radius))


@wp.func
def capsule_bend(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> wp.vec4:
    """Ridge and curvature [1/µm] about the axis of a capsule, or about the centre of its cap."""
    bend = ball_bend(obstacles, o, point, outward, radius)
    if wp.abs(point[2]) <= obstacles.size[o][1]:
        bend[2] = 1.0
    return bend


@wp.func
def cylinder_bend(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> wp.vec4:
    """Ridge and curvature [1/µm] about the axis of a cylinder, or about its rim."""
    bend = wp.vec4(0.0)
    if outward[2] == 0.0:
        bend = wp.vec4(0.0, 0.0, 1.0, 1.0 / (obstacles.size[o][0] + radius))
    elif wp.abs(outward[2]) < 1.0:
        ridge = wp.normalize(wp.vec3(-point[1], point[0], 0.0))
        bend = wp.vec4(ridge[0], ridge[1], 0.0, 1.0 / radius)
    return bend


@wp.func
def box_bend(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float) -> wp.vec4:
    """Ridge and curvature [1/µm] about an edge of a box, or about a corner, which has no ridge."""
    along = wp.vec3(
        wp.where(outward[0] == 0.0, 1.0, 0.0),
        wp.where(outward[1] == 0.0, 1.0, 0.0),
        wp.where(outward[2] == 0.0, 1.0, 0.0),
    )
    level = along[0] + along[1] + along[2]
    bend = wp.vec4(0.0)
    if level == 1.0:
        bend = wp.vec4(along[0], along[1], along[2], 1.0 / radius)
    elif level == 0.0:
        bend = wp.vec4(0.0, 0.0, 0.0, 1.0 / radius)
    return bend


RADII = {"sphere": ball_radius, "cylinder": cylinder_radius, "capsule": capsule_radius}
"""R before the shapes that are not flat, by name."""

BENDS = {"box": box_bend, "sphere": ball_bend, "cylinder": cylinder_bend, "capsule": capsule_bend}
"""Paths of centres along the shapes where they are not straight all over, by name."""


def _by_shape(rows: dict[str, wp.Function], otherwise: wp.Function, shapes: tuple[str, ...]) -> wp.Function:
    """The row of the only shape of a scene, or a branch on the obstacle's key; `otherwise` where there is none."""
    rounded = [shape for shape in shapes if shape in rows]
    if not rounded:
        return otherwise
    head = rows[rounded[0]]
    if len(shapes) == 1:
        return head
    key = SHAPES[rounded[0]][0]
    rest = _by_shape(rows, otherwise, tuple(shape for shape in shapes if shape != rounded[0]))

    @wp.func
    def either(obstacles: ObstacleData, o: int, point: wp.vec3, outward: wp.vec3, radius: float):
        """What this shape answers, or one of the rest."""
        result = otherwise(obstacles, o, point, outward, radius)
        if obstacles.shape[o] == wp.static(key):
            result = head(obstacles, o, point, outward, radius)
        else:
            result = rest(obstacles, o, point, outward, radius)
        return result

    return either


def relative_radius_term(shapes: tuple[str, ...]) -> wp.Function:
    """`(obstacles, o, point, outward, radius) -> R` of a sphere of that radius [µm] at `point`.

    `point` is in the obstacle's frame, `outward` the normal there.

    Args:
        shapes: Those that the scene has.
    """
    return _by_shape(RADII, flat_radius, shapes)


def path_bend_term(shapes: tuple[str, ...]) -> wp.Function:
    """`(obstacles, o, point, outward, radius) -> vec4`: how the centre of a sphere moves along an obstacle.

    `point` is that centre in the obstacle's frame, `outward` the normal there; the result is ridge and
    curvature [1/µm] of the surface that centres of touching spheres lie on, see `Contact`. Meshes count as flat, and
    the rim of a cylinder as straight.

    Args:
        shapes: Those that the scene has.
    """
    return _by_shape(BENDS, straight, shapes)


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
