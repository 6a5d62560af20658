"""Obstacles: signed distance and outward normal of each shape, and the pose of a moving one.

A shape has the signature `(obstacles, index, point, reach) -> vec4(normal, distance)` in its local frame; `reach`
bounds the search of a mesh. Distances of boxes and cylinders are exact outside and inside. A new shape is one
function and one line of `SHAPES`.
"""

import warp as wp

from otwarp.kernels.core.keyframes import find_key, key_weight, row_at
from otwarp.kernels.core.types import ObstacleData, Pose

FAR = wp.constant(1.0e9)


@wp.func
def plane_distance(obstacles: ObstacleData, index: int, point: wp.vec3, reach: float) -> wp.vec4:
    """Normal and signed distance [µm] to the half space z < 0."""
    return wp.vec4(0.0, 0.0, 1.0, point[2])


@wp.func
def ball_distance(obstacles: ObstacleData, index: int, point: wp.vec3, reach: float) -> wp.vec4:
    """Normal and signed distance [µm] to a sphere of radius size[0]."""
    distance = wp.length(point)
    n = wp.vec3(0.0, 0.0, 1.0)
    if distance > 0.0:
        n = point / distance
    return wp.vec4(n[0], n[1], n[2], distance - obstacles.size[index][0])


@wp.func
def box_distance(obstacles: ObstacleData, index: int, point: wp.vec3, reach: float) -> wp.vec4:
    """Normal and signed distance [µm] to a box of half extents size: nearest point outside, nearest face inside."""
    half = obstacles.size[index]
    side = wp.vec3(wp.sign(point[0]), wp.sign(point[1]), wp.sign(point[2]))
    over = wp.vec3(wp.abs(point[0]), wp.abs(point[1]), wp.abs(point[2])) - half
    outside = wp.vec3(wp.max(over[0], 0.0), wp.max(over[1], 0.0), wp.max(over[2], 0.0))
    distance = wp.length(outside)
    n = wp.vec3(0.0)
    if distance > 0.0:
        n = wp.cw_mul(outside / distance, side)
    else:
        distance = wp.max(over[0], wp.max(over[1], over[2]))
        if over[0] == distance:
            n = wp.vec3(side[0], 0.0, 0.0)
        elif over[1] == distance:
            n = wp.vec3(0.0, side[1], 0.0)
        else:
            n = wp.vec3(0.0, 0.0, side[2])
    return wp.vec4(n[0], n[1], n[2], distance)


@wp.func
def cylinder_distance(obstacles: ObstacleData, index: int, point: wp.vec3, reach: float) -> wp.vec4:
    """Normal and signed distance [µm] to a capped cylinder about z of radius size[0] and half height size[1]."""
    size = obstacles.size[index]
    rho = wp.sqrt(point[0] * point[0] + point[1] * point[1])
    radial = wp.vec3(1.0, 0.0, 0.0)
    if rho > 0.0:
        radial = wp.vec3(point[0] / rho, point[1] / rho, 0.0)
    cap = wp.vec3(0.0, 0.0, wp.sign(point[2]))
    over_r = rho - size[0]
    over_z = wp.abs(point[2]) - size[1]
    distance = wp.max(over_r, over_z)
    n = wp.where(over_r > over_z, radial, cap)
    if over_r > 0.0 and over_z > 0.0:
        distance = wp.sqrt(over_r * over_r + over_z * over_z)
        n = (over_r * radial + over_z * cap) / distance
    return wp.vec4(n[0], n[1], n[2], distance)


@wp.func
def capsule_distance(obstacles: ObstacleData, index: int, point: wp.vec3, reach: float) -> wp.vec4:
    """Normal and signed distance [µm] to a capsule about z of radius size[0], half height size[1] without caps."""
    size = obstacles.size[index]
    way = point - wp.vec3(0.0, 0.0, wp.clamp(point[2], -size[1], size[1]))
    distance = wp.length(way)
    n = wp.vec3(1.0, 0.0, 0.0)
    if distance > 0.0:
        n = way / distance
    return wp.vec4(n[0], n[1], n[2], distance - size[0])


@wp.func
def mesh_distance(obstacles: ObstacleData, index: int, point: wp.vec3, reach: float) -> wp.vec4:
    """Normal and signed distance [µm] to a triangle mesh: closed, or a thin sheet that has two sides.

    The sign before a closed one is that of the pseudo-normal of the closest feature (Bærentzen & Aanæs 2005,
    doi:10.1109/TVCG.2005.49).
    """
    result = wp.vec4(0.0, 0.0, 1.0, FAR)
    mesh = obstacles.mesh[index]
    query = wp.mesh_query_point_sign_normal(mesh, point, reach)
    if query.result:
        way = point - wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        distance = wp.length(way)
        sign = wp.where(obstacles.sheet[index] != 0, 1.0, query.sign)
        n = wp.mesh_eval_face_normal(mesh, query.face)
        if distance > 1.0e-6:
            n = (sign / distance) * way
        result = wp.vec4(n[0], n[1], n[2], sign * distance)
    return result


SHAPES: dict[str, tuple[int, wp.Function]] = {
    "plane": (0, plane_distance),
    "box": (1, box_distance),
    "sphere": (2, ball_distance),
    "cylinder": (3, cylinder_distance),
    "capsule": (4, capsule_distance),
    "mesh": (5, mesh_distance),
}
"""Shapes by name: the key stored in `ObstacleData.shape`, and the distance function."""


def distance_term(shapes: tuple[str, ...]) -> wp.Function:
    """One distance function for the shapes a scene uses: the shape itself, or a branch on the obstacle's key."""
    key, head = SHAPES[shapes[0]]
    if len(shapes) == 1:
        return head
    rest = distance_term(shapes[1:])

    @wp.func
    def either(obstacles: ObstacleData, index: int, point: wp.vec3, reach: float) -> wp.vec4:
        """Normal and signed distance [µm] of this shape, or of one of the rest, by the obstacle's key."""
        result = wp.vec4(0.0)
        if obstacles.shape[index] == wp.static(key):
            result = head(obstacles, index, point, reach)
        else:
            result = rest(obstacles, index, point, reach)
        return result

    return either


@wp.func
def still_pose(obstacles: ObstacleData, index: int, time: wp.float64) -> Pose:
    """World pose of an obstacle at rest [µm]."""
    key = obstacles.key_start[index]
    return Pose(obstacles.key_position[key], obstacles.key_rotation[key])


@wp.func
def moving_pose(obstacles: ObstacleData, index: int, time: wp.float64) -> Pose:
    """World pose at `time` [s]: position [µm] interpolated linearly, rotation by normalised linear interpolation."""
    first = obstacles.key_start[index]
    last = obstacles.key_start[index + 1] - 1
    pose = Pose(obstacles.key_position[first], obstacles.key_rotation[first])
    if last > first:
        key = find_key(obstacles.key_time, first, last, time)
        w = key_weight(obstacles.key_time, key, time)
        pose.position = (1.0 - w) * obstacles.key_position[key] + w * obstacles.key_position[key + 1]
        pose.rotation = wp.normalize((1.0 - w) * obstacles.key_rotation[key] + w * obstacles.key_rotation[key + 1])
    return pose


@wp.func
def pose_by_step(obstacles: ObstacleData, index: int, time: wp.float64) -> Pose:
    """The same at the `time` [s] of a step whose key frames have been looked up for all worlds."""
    row = row_at(obstacles.step_times, time)
    return Pose(obstacles.step_position[row, index], obstacles.step_rotation[row, index])
