"""From actions to traps within a period of control."""

import warp as wp

from otwarp.envs.kernels.types import EpisodeData, PlaceData
from otwarp.kernels.core.features import CPU_FLAGS
from otwarp.kernels.core.types import ControlData, StateData, WorldsData
from otwarp.kernels.drivers.lane_groups import from_start

STANDING = wp.constant(2)
"""In `EpisodeData.held`: the world has ended before, and stands still until it is reset."""


@wp.struct
class HandData:
    """What the numbers of an action move and set; a number has one purpose, a trap one hand."""

    axis: wp.array2d(dtype=wp.int32)  # (T, 3) number of the action that moves a trap along x, y, z, -1 none
    power: wp.array(dtype=wp.int32)  # (T) number that sets its power, -1 none


@wp.func
def velocity_of(hands: HandData, place: PlaceData, episode: EpisodeData, world: int, trap: int) -> wp.vec3:
    """Velocity of a trap by the action of the period [µm/s], no faster than hands may be."""
    share = wp.vec3(0.0)
    for axis in range(3):
        if hands.axis[trap, axis] >= 0:
            share[axis] = episode.action[world, hands.axis[trap, axis]]
    return (place.speed_limit / wp.max(wp.length(share), 1.0)) * share


@wp.func
def take_in(actions: wp.array2d(dtype=wp.float32), hands: HandData, place: PlaceData, time_step: wp.float64,
            worlds: WorldsData, control: ControlData, state: StateData, episode: EpisodeData, world: int):  # fmt: skip
    """At the start of a period: remember where bodies are, take in the action, set powers, and let traps glide."""
    if worlds.done[world] != 0:
        if episode.held[world] == 0:
            episode.held[world] = STANDING
        return
    for b in range(episode.before.shape[1]):
        episode.before[world, b] = state.position[world, b]
    for b in range(episode.turned.shape[1]):
        episode.turned[world, b] = state.orientation[world, b]
    for a in range(episode.action.shape[1]):
        episode.last_action[world, a] = episode.action[world, a]
        episode.action[world, a] = wp.clamp(actions[world, a], -1.0, 1.0)
    for t in range(episode.power.shape[1]):
        if hands.power[t] >= 0:
            share = 0.5 * (1.0 + episode.action[world, hands.power[t]])
            power = place.low_power + share * (place.high_power - place.low_power)
            episode.power[world, t] = power
            control.trap_power[world, t] = power
    if control.trap_velocity.shape[1] > 0:
        control.trap_since[world] = wp.float64(worlds.step[world]) * time_step
        for t in range(episode.focus.shape[1]):
            velocity = velocity_of(hands, place, episode, world, t)
            control.trap_velocity[world, t] = velocity
            episode.focus[world, t] = episode.focus[world, t] + place.period * velocity


@wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
def take(actions: wp.array2d(dtype=wp.float32), hands: HandData, place: PlaceData, time_step: wp.float64,
         worlds: WorldsData, control: ControlData, state: StateData, episode: EpisodeData, each: int):  # fmt: skip
    """Take in the actions of `each` worlds a thread, and begin the list of those whose episodes end in the period."""
    if wp.tid() == 0:
        episode.over_count[0] = 0
    first = wp.tid() * each
    for w in range(first, wp.min(first + each, worlds.done.shape[0])):
        take_in(actions, hands, place, time_step, worlds, control, state, episode, from_start(w))
