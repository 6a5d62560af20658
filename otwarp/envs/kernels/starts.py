"""Worlds that start anew, with random numbers of their own."""

import warp as wp

from otwarp.envs.kernels.rows import RowData, copy_rows
from otwarp.envs.kernels.types import EpisodeData
from otwarp.kernels.core.random import Stream, philox, uniform, vec4u
from otwarp.kernels.core.types import ControlData, ModelData, ReadoutData, StateData
from otwarp.kernels.drivers.episodes import restart_world

NEXT_EPISODE = wp.constant(wp.uint32(2654435769))
"""Distance between the trials of one environment's episodes: 2³² over the golden ratio, so that environments of
neighbouring seeds share no trial as long as environments × episodes stay below 1.9·10⁹ (three-distance theorem)."""
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
    state: StateData  # poses at which each world started (W, …), written at its start; the rest as in the scene
    rows: wp.array(dtype=RowData)  # what worlds take from a row of the table, (0) where there is one variant


@wp.func
def box_point(start: StartData, number: wp.uint32, place: int, half: wp.vec3) -> wp.vec3:
    """A uniform point of a box about 0, with these half widths."""
    words = philox(vec4u(wp.uint32(place), wp.uint32(0), number, wp.uint32(0)), start.seed,
                   wp.uint32(wp.static(int(Stream.ENVIRONMENT))))  # fmt: skip
    u = wp.vec3(uniform(words[0]), uniform(words[1]), uniform(words[2]))
    return wp.cw_mul(half, 2.0 * u - wp.vec3(1.0))


@wp.func
def draw(start: StartData, world: int, episode: EpisodeData):
    """The next trial of a world, and where its bodies start."""
    number = episode.number[world] + NEXT_EPISODE
    episode.number[world] = number
    words = philox(vec4u(wp.uint32(VARIANT), wp.uint32(0), number, wp.uint32(0)), start.seed,
                   wp.uint32(wp.static(int(Stream.ENVIRONMENT))))  # fmt: skip
    variant = wp.int32((wp.uint64(words[0]) * wp.uint64(start.variants)) >> wp.uint64(32))
    episode.variant[world] = variant
    row = wp.where(start.position.shape[0] == 1, 0, variant)
    for b in range(start.state.position.shape[1]):
        place = start.position[row, b]
        group = start.body_group[b]
        if group >= 0:
            place = place + start.middle[group] + box_point(start, number, SHIFT + group, start.half[group])
        start.state.position[world, b] = place
        episode.start[world, b] = place
        episode.before[world, b] = place
    row = wp.where(start.orientation.shape[0] == 1, 0, variant)
    for b in range(start.state.orientation.shape[1]):
        start.state.orientation[world, b] = start.orientation[row, b]
    episode.goal[world] = start.goal + box_point(start, number, GOAL, start.goal_half)


@wp.func
def begin(start: StartData, control: ControlData, state: StateData, world: int, episode: EpisodeData):
    """After the bodies of a world have been put there: its traps, and an empty memory."""
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
    for b in range(episode.gap.shape[1]):
        episode.gap[world, b] = wp.nan
    episode.energy[world] = float(0.0)
    episode.period[world] = 0
    episode.held[world] = 0


@wp.func
def start_anew(
    start: StartData, model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, world: int,
    episode: EpisodeData,
):  # fmt: skip
    """Start the next episode of a world."""
    draw(start, world, episode)
    copy_rows(start.rows, episode.variant[world], world)
    restart_world(model, state, readout, start.state, world, episode.number[world])
    begin(start, control, state, world, episode)
