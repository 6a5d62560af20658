"""What commonly ends the task of a world, as plain functions that `otwarp.end` compiles where they are used."""

import warp as wp

from otwarp.kernels.core.types import WorldNow


def escaped(now: WorldNow) -> bool:
    """Some trap has lost the sphere that it held; `readout.escape_step` says which and when, to a step."""
    lost = bool(False)
    for trap in range(now.readout.escape_step.shape[1]):
        lost = lost or now.readout.escape_step[now.world, trap] >= wp.int64(0)
    return lost


def reached(now: WorldNow, goal: wp.vec3, radius: float, body: int = 0) -> bool:
    """The centre of diffusion of a body is within `radius` of `goal` [µm]."""
    return wp.length(now.state.position[now.world, body] - goal) <= radius


def strayed(now: WorldNow, origin: wp.vec3, radius: float, body: int = 0) -> bool:
    """The centre of diffusion of a body is farther than `radius` from `origin` [µm]."""
    return wp.length(now.state.position[now.world, body] - origin) > radius


def left_behind(now: WorldNow, distance: float, cell: int, left: int, right: int) -> bool:
    """The centre of a cell is farther than `distance` [µm] from the middle of the two robots that carry it."""
    middle = 0.5 * (now.state.position[now.world, left] + now.state.position[now.world, right])
    return wp.length(now.state.position[now.world, cell] - middle) > distance


def timed_out(now: WorldNow, after: float) -> bool:
    """A world has run for `after` seconds since it was started or reset."""
    return now.time >= after
