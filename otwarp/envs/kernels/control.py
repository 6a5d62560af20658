"""From actions to traps within a period of control, and worlds that start anew with random numbers of their own."""

import warp as wp

from otwarp.envs.kernels.types import EpisodeData, PlaceData
from otwarp.kernels.core.random import Stream, philox, uniform, vec4u
from otwarp.kernels.core.types import ControlData, StateData, WorldsData

NEXT_EPISODE = wp.constant(wp.uint32(2654435769))
"""Distance between the trials of one environment's episodes: 2³² over the golden ratio, so that environments of
neighbouring seeds share no trial as long as environments × episodes stay below 1.9·10⁹ (three-distance theorem)."""
HELD = wp.constant(1 << 20)
"""Code of a world that has been reset and waits for the end of the period."""
STANDING = wp.constant(2)
"""In `EpisodeData.held`: the world has ended before, and stands still until it is reset."""
VARIANT, GOAL, SHIFT = wp.constant(0), wp.constant(1), wp.constant(2)
"""Places among the random numbers of an episode; `SHIFT` + n is the n-th group that is moved."""


@wp.struct
class StartData:
    """How episodes start: G groups of bodies and traps that are shifted together."""

    seed: wp.uint32
    variants: wp.int32  # rows of the table of randomised parameters, 1 for none
    position: wp.array2d(dtype=wp.vec3)  # (1|V, B) reference points [µm]
    orientation: wp.array2d(dtype=wp.quat)  # (1|V, B), (1, 0) where nothing turns
    focus: wp.array2d(dtype=wp.vec3)  # (1|V, T) [µm]
    power: wp.array2d(dtype=wp.float32)  # (1|V, T) [mW]
    body_group: wp.array(dtype=wp.int32)  # (B) group that shifts it, -1 none
    trap_group: wp.array(dtype=wp.int32)  # (T)
    half: wp.array(dtype=wp.vec3)  # (G) half widths of the boxes of shifts [µm]
    middle: wp.array(dtype=wp.vec3)  # (G) and their middles, from where the scene has what they shift [µm]
    goal: wp.vec3  # [µm]
    goal_half: wp.vec3
    body: wp.array2d(dtype=wp.vec3)  # out: (W, B) where the chosen worlds start [µm]
    turned: wp.array2d(dtype=wp.quat)  # out: (W, B) and how their bodies lie, (W, 0) where nothing turns


@wp.struct
class HandData:
    """What the numbers of an action move and set; a number has one purpose, a trap one hand."""

    axis: wp.array2d(dtype=wp.int32)  # (T, 3) number of the action that moves a trap along x, y, z, -1 none
    power: wp.array(dtype=wp.int32)  # (T) number that sets its power, -1 none


@wp.func
def box_point(start: StartData, number: wp.uint32, place: int, half: wp.vec3) -> wp.vec3:
    """A uniform point of a box about 0, with these half widths."""
    words = philox(vec4u(wp.uint32(place), wp.uint32(0), number, wp.uint32(0)), start.seed,
                   wp.uint32(wp.static(int(Stream.ENVIRONMENT))))  # fmt: skip
    u = wp.vec3(uniform(words[0]), uniform(words[1]), uniform(words[2]))
    return wp.cw_mul(half, 2.0 * u - wp.vec3(1.0))


@wp.kernel(enable_backward=False)
def draw(start: StartData, worlds: WorldsData, ended: int, episode: EpisodeData):
    """For each flagged world: its next trial, and where its bodies start; with `ended`, flag those that have ended."""
    world = wp.tid()
    if ended != 0:
        episode.flags[world] = wp.where(worlds.done[world] != 0, 1, 0)
    if episode.flags[world] == 0:
        return
    number = episode.number[world] + NEXT_EPISODE
    episode.number[world] = number
    words = philox(vec4u(wp.uint32(VARIANT), wp.uint32(0), number, wp.uint32(0)), start.seed,
                   wp.uint32(wp.static(int(Stream.ENVIRONMENT))))  # fmt: skip
    variant = wp.int32((wp.uint64(words[0]) * wp.uint64(start.variants)) >> wp.uint64(32))
    episode.variant[world] = variant
    row = wp.where(start.position.shape[0] == 1, 0, variant)
    for b in range(start.body.shape[1]):
        place = start.position[row, b]
        group = start.body_group[b]
        if group >= 0:
            place = place + start.middle[group] + box_point(start, number, SHIFT + group, start.half[group])
        start.body[world, b] = place
        episode.start[world, b] = place
        episode.before[world, b] = place
    row = wp.where(start.orientation.shape[0] == 1, 0, variant)
    for b in range(start.turned.shape[1]):
        start.turned[world, b] = start.orientation[row, b]
    episode.goal[world] = start.goal + box_point(start, number, GOAL, start.goal_half)


@wp.kernel(enable_backward=False)
def begin(
    start: StartData, control: ControlData, state: StateData, worlds: WorldsData, hold: int, episode: EpisodeData
):  # fmt: skip
    """For each flagged world, after its bodies have been put there: its traps, and an empty memory."""
    world = wp.tid()
    if episode.flags[world] == 0:
        return
    row = wp.where(start.focus.shape[0] == 1, 0, episode.variant[world])
    for t in range(episode.focus.shape[1]):
        place = start.focus[row, t]
        group = start.trap_group[t]
        if group >= 0:
            place = place + start.middle[group]
            place = place + box_point(start, episode.number[world], SHIFT + group, start.half[group])
        episode.focus[world, t] = place
        control.trap_position[world, t] = place
        if state.trap_position.shape[1] > 0:
            state.trap_position[world, t] = place
        power = start.power[wp.where(start.power.shape[0] == 1, 0, episode.variant[world]), t]
        episode.power[world, t] = power
        control.trap_power[world, t] = power
    for b in range(episode.turned.shape[1]):
        episode.turned[world, b] = state.orientation[world, b]
    for a in range(episode.action.shape[1]):
        episode.action[world, a] = float(0.0)
        episode.last_action[world, a] = float(0.0)
    episode.energy[world] = float(0.0)
    episode.period[world] = 0
    episode.held[world] = hold
    if hold != 0:
        worlds.done[world] = HELD


@wp.func
def velocity_of(hands: HandData, place: PlaceData, episode: EpisodeData, world: int, trap: int) -> wp.vec3:
    """Velocity of a trap by the action of the period [µm/s], no faster than hands may be."""
    share = wp.vec3(0.0)
    for axis in range(3):
        if hands.axis[trap, axis] >= 0:
            share[axis] = episode.action[world, hands.axis[trap, axis]]
    return (place.speed_limit / wp.max(wp.length(share), 1.0)) * share


@wp.kernel(enable_backward=False)
def take(actions: wp.array2d(dtype=wp.float32), hands: HandData, place: PlaceData, time_step: wp.float64,
         worlds: WorldsData, control: ControlData, state: StateData, episode: EpisodeData):  # fmt: skip
    """At the start of a period: remember where bodies are, take in the action, set powers, and let traps glide."""
    world = wp.tid()
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
