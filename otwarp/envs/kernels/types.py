"""Structs of environments: W worlds, T traps, B bodies, S spheres, A numbers of an action. Units µm, s, mW."""

import warp as wp

from otwarp.kernels.core.types import ObstacleData, ReadoutData, StateData


@wp.struct
class PlaceData:
    """What never changes of a scene, as far as terms read it."""

    sphere_start: wp.array(dtype=wp.int32)  # (B + 1) first sphere of each body
    sphere: wp.array(dtype=wp.vec4)  # (S) offset from the reference point, body frame, and radius [µm]
    held_body: wp.array(dtype=wp.int32)  # (T) body of the sphere that a trap holds, -1 none
    held_offset: wp.array(dtype=wp.vec3)  # (T) of that sphere [µm]
    equilibrium: wp.array(dtype=wp.vec3)  # (T) of a trap, from its focus [µm]
    hand: wp.array(dtype=wp.int32)  # (T) hand that moves it, -1 none
    obstacles: ObstacleData
    obstacle_position: wp.array2d(dtype=wp.vec3)  # (P, O) after 0, 1, … periods of control, at last for good [µm]
    obstacle_rotation: wp.array2d(dtype=wp.quat)  # (P, O), (P, 0) where none is turned
    watched: wp.array(dtype=wp.int32)  # (N) bodies of which terms ask for the gap
    flow_speed: wp.array(dtype=wp.float32)  # (1|W) of the model [µm/s]
    period: wp.float32  # of control [s]
    time_limit: wp.float32  # after which an episode is cut off [s]
    speed_limit: wp.float32  # of a hand along each axis [µm/s]
    low_power: wp.float32  # [mW]
    high_power: wp.float32


@wp.struct
class EpisodeData:
    """What changes from period to period."""

    goal: wp.array(dtype=wp.vec3)  # (W) [µm]
    focus: wp.array2d(dtype=wp.vec3)  # (W, T) where traps have been put [µm]
    power: wp.array2d(dtype=wp.float32)  # (W, T) [mW]
    energy: wp.array(dtype=wp.float32)  # (W) of all traps since the start of the episode [mW·s]
    start: wp.array2d(dtype=wp.vec3)  # (W, B) reference points at the start [µm]
    before: wp.array2d(dtype=wp.vec3)  # (W, B) reference points at the end of the last period [µm]
    turned: wp.array2d(dtype=wp.quat)  # (W, B) orientations then, (W, 0) where nothing turns
    action: wp.array2d(dtype=wp.float32)  # (W, A) of this period, within ±1
    last_action: wp.array2d(dtype=wp.float32)  # (W, A) of the one before
    gap: wp.array2d(dtype=wp.float32)  # (W, B) of a body's spheres from obstacles [µm], NaN: not found
    period: wp.array(dtype=wp.int32)  # (W) periods since the start of the episode
    held: wp.array(dtype=wp.int32)  # (W) 1: reset in this period, and waits for its end; 2: ended before
    number: wp.array(dtype=wp.uint32)  # (W) trial, which all random numbers of the episode go by
    over: wp.array(dtype=wp.int32)  # (W) worlds whose episodes the last period has found over, in the first places
    over_count: wp.array(dtype=wp.int32)  # (1) how many; their order matters to no result
    variant: wp.array(dtype=wp.int32)  # (W) row of the table of randomised parameters


@wp.struct
class TaskNow:
    """What a term of a task may depend on: a world at the end of a period of control."""

    world: wp.int32  # index of the world, the row of the arrays
    period: wp.int32  # periods since the start of the episode
    time: wp.float32  # the same [s]
    state: StateData
    readout: ReadoutData
    place: PlaceData
    episode: EpisodeData
