"""What observations, rewards and ends are made of: plain functions that a task compiles with those it uses."""

import warp as wp

from otwarp.envs.kernels.geometry import (
    alignment_of,
    as_turned,
    body_place,
    gap_between,
    gap_of,
    obstacle_place,
    surface_of,
    trap_offset_of,
)
from otwarp.envs.kernels.types import TaskNow


def goal_offset(now: TaskNow, body: int) -> wp.vec3:
    """Way from a body to the goal."""
    return now.episode.goal[now.world] - body_place(now, body)


def body_position(now: TaskNow, body: int) -> wp.vec3:
    """Where a body is."""
    return body_place(now, body)


def body_offset(now: TaskNow, body: int, other: int) -> wp.vec3:
    """Way from a body to another one."""
    return body_place(now, other) - body_place(now, body)


def body_velocity(now: TaskNow, body: int) -> wp.vec3:
    """Mean velocity of a body over the last period; 0 at the start."""
    return (body_place(now, body) - now.episode.before[now.world, body]) / now.place.period


def body_axis(now: TaskNow, body: int, axis: wp.vec3) -> wp.vec3:
    """Where an axis of a body's own frame points."""
    return as_turned(now, body, axis)


def trap_offset(now: TaskNow, trap: int) -> wp.vec3:
    """Way from the sphere that a trap holds to the trap's equilibrium point: what its force goes by."""
    return trap_offset_of(now, trap)


def trap_position(now: TaskNow, trap: int) -> wp.vec3:
    """Where the focus of a trap has been put."""
    return now.episode.focus[now.world, trap]


def trap_power(now: TaskNow, trap: int) -> float:
    """Power of a trap."""
    return now.episode.power[now.world, trap]


def trap_spread(now: TaskNow, trap: int, second: int) -> wp.vec3:
    """Way from the focus of a trap to that of another one."""
    return now.episode.focus[now.world, second] - now.episode.focus[now.world, trap]


def obstacle_offset(now: TaskNow, body: int, obstacle: int) -> wp.vec3:
    """Way from a body's reference point to the nearest point of an obstacle's surface."""
    found = surface_of(now, obstacle, body_place(now, body))
    return -found[3] * wp.vec3(found[0], found[1], found[2])


def obstacle_velocity(now: TaskNow, obstacle: int) -> wp.vec3:
    """Velocity of an obstacle's origin over the last period."""
    last = obstacle_place(now, obstacle, now.period)
    before = obstacle_place(now, obstacle, now.period - 1)
    return (last - before) / now.place.period


def gap(now: TaskNow, body: int) -> float:
    """Least distance between the spheres of a body and an obstacle."""
    return gap_of(now, body)


def contact_load(now: TaskNow, body: int) -> float:
    """Sum of the normal forces that press on a body, mean over the last step."""
    load = float(0.0)
    if now.readout.contact_load.shape[1] > 0:
        load = now.readout.contact_load[now.world, body]
    return load


def time_left(now: TaskNow) -> float:
    """Time until the episode is cut off."""
    return now.place.time_limit - now.time


def progress(now: TaskNow, body: int) -> float:
    """How much nearer to the goal a body has come in the last period."""
    goal = now.episode.goal[now.world]
    return wp.length(now.episode.before[now.world, body] - goal) - wp.length(body_place(now, body) - goal)


def goal_distance(now: TaskNow, body: int) -> float:
    """Distance of a body from the goal."""
    return wp.length(now.episode.goal[now.world] - body_place(now, body))


def lag(now: TaskNow, trap: int) -> float:
    """Distance of the sphere that a trap holds from the trap's equilibrium point."""
    return wp.length(trap_offset_of(now, trap))


def worst_lag(now: TaskNow) -> float:
    """Largest distance of a held sphere from its trap's equilibrium point."""
    most = float(0.0)
    for trap in range(now.place.held_body.shape[0]):
        most = wp.max(most, wp.length(trap_offset_of(now, trap)))
    return most


def total_power(now: TaskNow) -> float:
    """Sum of the powers of all traps."""
    total = float(0.0)
    for trap in range(now.episode.power.shape[1]):
        total = total + now.episode.power[now.world, trap]
    return total


def mean_power(now: TaskNow) -> float:
    """Sum of the powers of all traps, mean since the start of the episode."""
    return now.episode.energy[now.world] / wp.max(now.time, now.place.period)


def nearness(now: TaskNow, body: int, margin: float) -> float:
    """By how much of `margin` [µm] a body is nearer to an obstacle than that: 0 beyond, 1 in touch."""
    return wp.clamp(1.0 - gap_of(now, body) / margin, 0.0, 1.0)


def alignment(now: TaskNow, body: int, axis: wp.vec3, wanted: wp.vec3) -> float:
    """Cosine between an axis of a body's own frame and a wanted direction."""
    return alignment_of(now, body, axis, wanted)


def alignment_gain(now: TaskNow, body: int, axis: wp.vec3, wanted: wp.vec3) -> float:
    """How much `alignment` has grown in the last period."""
    before = wp.quat_identity()
    if now.episode.turned.shape[1] > 0:
        before = now.episode.turned[now.world, body]
    was = wp.dot(wp.quat_rotate(before, wp.normalize(axis)), wp.normalize(wanted))
    return alignment_of(now, body, axis, wanted) - was


def action_size(now: TaskNow) -> float:
    """Mean square of the numbers of the action."""
    total = float(0.0)
    count = now.episode.action.shape[1]
    for a in range(count):
        total = total + now.episode.action[now.world, a] * now.episode.action[now.world, a]
    return total / float(wp.max(count, 1))


def action_change(now: TaskNow) -> float:
    """Mean square of the change of the action's numbers from the period before."""
    total = float(0.0)
    count = now.episode.action.shape[1]
    for a in range(count):
        change = now.episode.action[now.world, a] - now.episode.last_action[now.world, a]
        total = total + change * change
    return total / float(wp.max(count, 1))


def arrival(now: TaskNow, body: int, radius: float) -> float:
    """1 in the period in which a body is within `radius` [µm] of the goal."""
    return wp.where(wp.length(now.episode.goal[now.world] - body_place(now, body)) <= radius, 1.0, 0.0)


def passing(now: TaskNow) -> float:
    """The length of a period: a cost of time."""
    return now.place.period


def reached(now: TaskNow, body: int, radius: float) -> bool:
    """A body is within `radius` [µm] of the goal."""
    return wp.length(now.episode.goal[now.world] - body_place(now, body)) <= radius


def strayed(now: TaskNow, body: int, radius: float) -> bool:
    """A body is farther than `radius` [µm] from where it started."""
    return wp.length(body_place(now, body) - now.episode.start[now.world, body]) > radius


def collided(now: TaskNow, body: int, clearance: float = 0.0) -> bool:
    """A sphere of a body is within `clearance` [µm] of an obstacle."""
    return gap_of(now, body) < clearance


def touched(now: TaskNow, body: int, obstacle: int, clearance: float = 0.0) -> bool:
    """A sphere of a body is within `clearance` [µm] of one obstacle."""
    return gap_between(now, body, obstacle) < clearance


def lost(now: TaskNow, distance: float) -> bool:
    """A sphere that a trap holds is farther than `distance` [µm] from the trap's equilibrium point."""
    far = bool(False)
    for trap in range(now.place.held_body.shape[0]):
        if now.place.held_body[trap] >= 0:
            far = far or wp.length(trap_offset_of(now, trap)) > distance
    return far


def escaped(now: TaskNow) -> bool:
    """A sphere has left the reach of the trap that held it."""
    gone = bool(False)
    for trap in range(now.readout.escape_step.shape[1]):
        gone = gone or now.readout.escape_step[now.world, trap] >= wp.int64(0)
    return gone


def left_behind(now: TaskNow, distance: float, cell: int, left: int, right: int) -> bool:
    """A cell is farther than `distance` [µm] from the middle of the two robots that carry it."""
    middle = 0.5 * (body_place(now, left) + body_place(now, right))
    return wp.length(body_place(now, cell) - middle) > distance


def aligned(now: TaskNow, body: int, axis: wp.vec3, wanted: wp.vec3, cosine: float) -> bool:
    """The cosine between an axis of a body's own frame and a wanted direction is at least `cosine`."""
    return alignment_of(now, body, axis, wanted) >= cosine


def kept_up(now: TaskNow, duration: float) -> bool:
    """The episode has lasted for `duration` seconds."""
    return now.time >= duration - 0.5 * now.place.period
