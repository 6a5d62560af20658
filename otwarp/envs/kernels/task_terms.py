"""What only the shipped tasks see, earn and end by: plain functions, as those of `terms`."""

import warp as wp

from otwarp.envs.kernels.geometry import body_place, gap_of, held_place, obstacle_place, thrift_of, trap_offset_of
from otwarp.envs.kernels.types import TaskNow


def middle_offset(now: TaskNow, body: int, obstacle: int) -> wp.vec3:
    """Way from a body to the middle of an obstacle."""
    return obstacle_place(now, obstacle, now.period) - body_place(now, body)


def approach(now: TaskNow, body: int, other: int) -> float:
    """How much nearer a body has come to another one in the last period."""
    before = wp.length(now.episode.before[now.world, body] - now.episode.before[now.world, other])
    return before - wp.length(body_place(now, body) - body_place(now, other))


def crash(now: TaskNow, body: int) -> float:
    """1 in the period in which a body has run into an obstacle."""
    return wp.where(gap_of(now, body) < 0.0, 1.0, 0.0)


def slip(now: TaskNow, distance: float) -> float:
    """1 in the period in which a held sphere has come farther than `distance` [µm] from its trap."""
    most = float(0.0)
    for trap in range(now.place.held_body.shape[0]):
        most = wp.max(most, wp.length(trap_offset_of(now, trap)))
    return wp.where(most > distance, 1.0, 0.0)


def parting(now: TaskNow, body: int, other: int, distance: float) -> float:
    """1 in the period in which a body is farther than `distance` [µm] from another one."""
    return wp.where(wp.length(body_place(now, body) - body_place(now, other)) > distance, 1.0, 0.0)


def parted(now: TaskNow, body: int, other: int, distance: float) -> bool:
    """A body is farther than `distance` [µm] from another one."""
    return wp.length(body_place(now, body) - body_place(now, other)) > distance


def raised(now: TaskNow, trap: int) -> float:
    """Height of the sphere that a trap holds above the middle of its body."""
    return held_place(now, trap)[2] - body_place(now, now.place.held_body[trap])[2]


def wanted_rise(now: TaskNow) -> float:
    """Height above the middle that is wanted of it: the z of the goal."""
    return now.episode.goal[now.world][2]


def rise_error(now: TaskNow, trap: int) -> float:
    """How far the height of the sphere that a trap holds is from the wanted one."""
    rise = held_place(now, trap)[2] - body_place(now, now.place.held_body[trap])[2]
    return wp.abs(rise - now.episode.goal[now.world][2])


def risen(now: TaskNow, trap: int, tolerance: float, after: float) -> bool:
    """Later than `after` seconds, the height is within `tolerance` [µm] of the wanted one."""
    rise = held_place(now, trap)[2] - body_place(now, now.place.held_body[trap])[2]
    return now.time >= after and wp.abs(rise - now.episode.goal[now.world][2]) <= tolerance


def risen_now(now: TaskNow, trap: int, tolerance: float, after: float) -> float:
    """1 in the period in which, later than `after` seconds, the height is within `tolerance` [µm] of the wanted one."""
    rise = held_place(now, trap)[2] - body_place(now, now.place.held_body[trap])[2]
    met = now.time >= after and wp.abs(rise - now.episode.goal[now.world][2]) <= tolerance
    return wp.where(met, 1.0, 0.0)


def dropped(now: TaskNow, cell: int, left: int, right: int, distance: float) -> float:
    """1 in the period in which a cell is farther than `distance` [µm] from the middle of the two that carry it."""
    middle = 0.5 * (body_place(now, left) + body_place(now, right))
    return wp.where(wp.length(body_place(now, cell) - middle) > distance, 1.0, 0.0)


def carried_off(now: TaskNow, cell: int, left: int, right: int) -> float:
    """Distance of a cell from the middle of the two that carry it."""
    middle = 0.5 * (body_place(now, left) + body_place(now, right))
    return wp.length(body_place(now, cell) - middle)


def held_with_little(now: TaskNow, duration: float, need: float, most: float) -> bool:
    """The robot has been held for `duration` seconds, by at most `most` times the least power in the mean."""
    return now.time >= duration - 0.5 * now.place.period and thrift_of(now, need) <= most


def thrift_now(now: TaskNow, duration: float, need: float, most: float) -> float:
    """1 in the period in which it has been held for `duration` seconds, by at most `most` times the least power."""
    met = now.time >= duration - 0.5 * now.place.period and thrift_of(now, need) <= most
    return wp.where(met, 1.0, 0.0)


def pressed(now: TaskNow, body: int, low: float, high: float) -> float:
    """1 where the contact force on a body is from `low` to `high` [pN], else -1."""
    load = now.readout.contact_load[now.world, body]
    return wp.where(load >= low and load <= high, 1.0, -1.0)
