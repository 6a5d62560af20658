"""What terms of tasks share: where spheres, traps and obstacles are, and how much power was spent."""

import warp as wp

from otwarp.envs.kernels.types import TaskNow
from otwarp.kernels.contact.obstacles import FAR, SHAPES, distance_term, moving_pose
from otwarp.kernels.core.packed import beside, distance_of, point_of
from otwarp.kernels.core.types import ObstacleData, world_row
from otwarp.kernels.drivers.lane_groups import from_start

shape_distance = distance_term(tuple(SHAPES))


@wp.func
def body_place(now: TaskNow, body: int) -> wp.vec3:
    """Reference point of a body [µm]."""
    return now.state.position[now.world, body]


@wp.func
def as_turned(now: TaskNow, body: int, way: wp.vec3) -> wp.vec3:
    """A vector of a body's own frame as the body lies; itself where nothing turns."""
    turned = way
    if now.state.orientation.shape[1] > 0:
        turned = wp.quat_rotate(now.state.orientation[now.world, body], way)
    return turned


@wp.func
def held_place(now: TaskNow, trap: int) -> wp.vec3:
    """Centre of the sphere that a trap holds [µm]; the trap's equilibrium if it holds none."""
    body = now.place.held_body[trap]
    place = now.episode.focus[now.world, trap] + now.place.equilibrium[trap]
    if body >= 0:
        place = body_place(now, body) + as_turned(now, body, now.place.held_offset[trap])
    return place


@wp.kernel(enable_backward=False)
def tabulate_poses(obstacles: ObstacleData, period: wp.float64, position: wp.array2d(dtype=wp.vec3),
                   rotation: wp.array2d(dtype=wp.quat)):  # fmt: skip
    """Poses of obstacles after so many periods of control, over (periods, obstacles)."""
    row, obstacle = wp.tid()
    pose = moving_pose(obstacles, obstacle, wp.float64(row) * period)
    position[row, obstacle] = pose.position
    rotation[row, obstacle] = pose.rotation


@wp.func
def pose_row(now: TaskNow, period: int) -> int:
    """Row of the table of poses so many periods of control after the start of the episode."""
    return from_start(wp.clamp(period, 0, now.place.obstacle_position.shape[0] - 1))


@wp.func
def obstacle_place(now: TaskNow, obstacle: int, period: int) -> wp.vec3:
    """Origin of an obstacle [µm] so many periods of control after the start of the episode."""
    return now.place.obstacle_position[pose_row(now, period), obstacle]


@wp.func
def in_obstacle(now: TaskNow, row: int, obstacle: int, way: wp.vec3) -> wp.vec3:
    """A vector in an obstacle's own frame, of which the pose is in a row of the table."""
    turned = way
    if now.place.obstacle_rotation.shape[1] > 0:
        turned = wp.quat_rotate_inv(now.place.obstacle_rotation[row, obstacle], way)
    return turned


@wp.func
def surface_of(now: TaskNow, obstacle: int, point: wp.vec3) -> wp.vec4:
    """Outward normal of an obstacle's surface nearest to a point, and the distance of the point from it [µm]."""
    row = pose_row(now, now.period)
    local = in_obstacle(now, row, obstacle, point - now.place.obstacle_position[row, obstacle])
    found = shape_distance(now.place.obstacles, obstacle, local, FAR)
    normal = point_of(found)
    if now.place.obstacle_rotation.shape[1] > 0:
        normal = wp.quat_rotate(now.place.obstacle_rotation[row, obstacle], normal)
    return beside(normal, distance_of(found))


@wp.func
def gap_between(now: TaskNow, body: int, obstacle: int) -> float:
    """Least distance between the spheres of a body and the surface of an obstacle [µm], negative where they overlap."""
    least = float(FAR)
    for s in range(now.place.sphere_start[body], now.place.sphere_start[body + 1]):
        sphere = now.place.sphere[s]
        point = body_place(now, body) + as_turned(now, body, point_of(sphere))
        least = wp.min(least, surface_of(now, obstacle, point)[3] - sphere[3])
    return least


@wp.func
def find_gap(now: TaskNow, body: int) -> float:
    """The same to the nearest of all obstacles [µm]."""
    least = float(FAR)
    row = pose_row(now, now.period)
    for s in range(now.place.sphere_start[body], now.place.sphere_start[body + 1]):
        sphere = now.place.sphere[s]
        point = body_place(now, body) + as_turned(now, body, point_of(sphere))
        for o in range(now.place.obstacles.shape.shape[0]):
            obstacle = from_start(o)
            way = point - now.place.obstacle_position[row, obstacle]
            # what is farther away than the nearest so far is not looked at
            near = least + now.place.obstacles.bound[obstacle] + sphere[3]
            if near > 0.0 and wp.length_sq(way) < near * near:
                local = in_obstacle(now, row, obstacle, way)
                clear = distance_of(shape_distance(now.place.obstacles, obstacle, local, FAR)) - sphere[3]
                least = wp.where(clear < least, clear, least)
    return least


@wp.func
def gap_of(now: TaskNow, body: int) -> float:
    """The same; of the bodies that terms name, it is found once for all terms of a period."""
    least = now.episode.gap[now.world, body]
    # not a number where it is not known; `wp.isnan` is a call on a CPU, which costs what is in registers
    if least != least:
        least = find_gap(now, body)
    return least


@wp.func
def known_gap(now: TaskNow, body: int) -> float:
    """The same of a body of which it has been found."""
    return now.episode.gap[now.world, body]


@wp.func
def find_gaps(now: TaskNow):
    """Find the gap of each body of which terms ask for it."""
    for n in range(now.place.watched.shape[0]):
        body = from_start(now.place.watched[n])
        now.episode.gap[now.world, body] = find_gap(now, body)


@wp.func
def trap_offset_of(now: TaskNow, trap: int) -> wp.vec3:
    """Way from the sphere that a trap holds to the trap's equilibrium point."""
    return now.episode.focus[now.world, trap] + now.place.equilibrium[trap] - held_place(now, trap)


@wp.func
def alignment_of(now: TaskNow, body: int, axis: wp.vec3, wanted: wp.vec3) -> float:
    """Cosine between an axis of a body's own frame and a wanted direction."""
    return wp.dot(as_turned(now, body, wp.normalize(axis)), wp.normalize(wanted))


@wp.func
def thrift_of(now: TaskNow, need: float) -> float:
    """Mean power over the least that holds a robot in the stream, `need` mW for each µm/s of it."""
    speed = now.place.flow_speed[world_row(now.place.flow_speed.shape[0], now.world)]
    return now.episode.energy[now.world] / wp.max(now.time, now.place.period) / (need * speed)
