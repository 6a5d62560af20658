"""Perception between the simulation's state and what a SIMULATED operator's chain and eyes get of it.

Once a servo period, for each world: a picture is due or not, by its own frame rate; the estimate that is made of it has
errors of its own in where each robot is and how it lies, or is none; it reaches the chain when its delay is over. The
chain gets the newest estimate that has, with the traps as they were in its picture. Before the start the scene stood
still, and pictures were taken of it.

An error e of a picture follows from that of the one before, e ← ρ e + √(1 − ρ²) σ ξ, ρ = exp(−1/(rate·correlation)):
ξ depends on seed, picture, operator and robot alone: the same under all conditions, delays and errors.
"""

import warp as wp

from otwarp.kernels.core.random import Stream, gaussian_pair, noise_words, uniform
from otwarp.operators.kernels.types import SightData

_PERCEPTION = wp.constant(wp.uint32(Stream.PERCEPTION))
_LOST = wp.constant(1 << 20)
"""Where it is drawn whether an estimate is made at all, beside robots, 2·robot and 2·robot + 1."""
ERRORS = 5
"""Numbers that are wrong of a robot: x, y, depth [µm], tilt, yaw [rad]."""
vec5d = wp.types.vector(length=ERRORS, dtype=wp.float64)


@wp.struct
class PerceptionRow:
    """Perception of one world."""

    number: wp.uint32  # key of its random numbers: the operator's
    delay: wp.int32  # from a picture to the chain [periods]
    frame_rate: wp.float64  # [1/s]
    keep: wp.float64  # ρ: what is left of an error in the next picture [1]
    deviation: vec5d  # σ of x, y, depth [µm], tilt about x, yaw about z [rad]
    bias: vec5d  # the same in every picture
    lost: wp.float64  # part of the pictures of which no estimate is made [1]
    exact: wp.int32  # not 0: no errors
    stamped: wp.int32  # not 0: the traps are those of the picture; 0: those of now
    twin: wp.int32  # not 0: the eyes see the estimate; 0: the scene, through a microscope


@wp.struct
class TruthData:
    """The state as it is: W worlds, S spheres, T traps, H hands."""

    sphere: wp.array2d(dtype=wp.vec3d)  # (W, S) [µm]
    trap: wp.array2d(dtype=wp.vec3d)  # (W, T) [µm]
    power: wp.array2d(dtype=wp.float64)  # (W, T) [mW]
    sight: SightData


@wp.struct
class PerceptionData:
    """All of perception: R places for estimates under way, B robots."""

    seed: wp.uint32
    rate: wp.float64  # of the servo [1/s]
    eye_rate: wp.float64  # pictures a second in a microscope [1/s]
    before: wp.float64  # for how long pictures were taken before the start [s]
    robots: wp.int32  # B
    robot: wp.array(dtype=wp.int32)  # (S) of each sphere
    held: wp.array(dtype=wp.int32)  # (T) sphere that a trap of a hand holds, -1 for none
    point: wp.array(dtype=wp.vec3d)  # (T) where it holds it, from the focus [µm]
    rows: wp.array(dtype=PerceptionRow)  # (W)
    now: wp.array(dtype=wp.int32)  # (W) periods since the start
    frame: wp.array(dtype=wp.int32)  # (W) the next picture, from 0 at the start
    eye_frame: wp.array(dtype=wp.int32)  # (W) the same of a microscope's
    taken: wp.array(dtype=wp.int32)  # (W) estimates so far
    served: wp.array(dtype=wp.int32)  # (W) of these, that the chain has got or will not
    error: wp.array2d(dtype=vec5d)  # (W, B) of the last picture, without bias
    tick: wp.array2d(dtype=wp.int32)  # (W, R) when the picture was taken [periods]
    sphere: wp.array3d(dtype=wp.vec3d)  # (W, R, S) [µm]
    trap: wp.array3d(dtype=wp.vec3d)  # (W, R, T) [µm]
    power: wp.array3d(dtype=wp.float64)  # (W, R, T) [mW]


@wp.struct
class ServedData:
    """What the chain gets, see `otwarp.operators.chain.ChainBatch`."""

    sphere: wp.array2d(dtype=wp.vec3d)  # (W, S) [µm]
    trap: wp.array2d(dtype=wp.vec3d)  # (W, T) [µm]
    power: wp.array2d(dtype=wp.float64)  # (W, T) [mW]
    time: wp.array(dtype=wp.float64)  # (W) of the picture [s]
    fresh: wp.array(dtype=wp.bool)  # (W) whether it is new in this period
    now: wp.array(dtype=wp.float64)  # (W) time of the scene [s]


@wp.func
def due(frame: int, rate: wp.float64, frame_rate: wp.float64) -> int:
    """Period at whose end a picture is taken, of pictures at `frame_rate` and periods at `rate` [1/s]."""
    return int(wp.floor(wp.float64(frame) * rate / frame_rate))


@wp.func
def err(data: PerceptionData, row: PerceptionRow, world: int, robot: int, frame: int, first: int) -> vec5d:
    """Errors of a robot in a picture, with bias [µm, rad]; the first picture of all has no one before."""
    step = wp.int64(frame)
    a = noise_words(data.seed, _PERCEPTION, step, int(row.number), 2 * robot)
    b = noise_words(data.seed, _PERCEPTION, step, int(row.number), 2 * robot + 1)
    g, h, k = gaussian_pair(a[0], a[1]), gaussian_pair(a[2], a[3]), gaussian_pair(b[0], b[1])
    fresh = vec5d(wp.float64(g[0]), wp.float64(g[1]), wp.float64(h[0]), wp.float64(h[1]), wp.float64(k[0]))
    fresh = wp.cw_mul(row.deviation, fresh)
    error = fresh
    if first == 0:
        error = row.keep * data.error[world, robot] + wp.sqrt(wp.float64(1.0) - row.keep * row.keep) * fresh
    data.error[world, robot] = error
    return error + row.bias


@wp.func
def is_lost(data: PerceptionData, row: PerceptionRow, frame: int) -> bool:
    """Whether no estimate is made of a picture, which has the probability `lost` [1]."""
    words = noise_words(data.seed, _PERCEPTION, wp.int64(frame), int(row.number), _LOST)
    return wp.float64(uniform(words[0])) <= row.lost


@wp.func
def turn_less_one(tilt: wp.float64, yaw: wp.float64) -> wp.mat33d:
    """R_z(yaw)·R_x(tilt) − 1 for angles [rad]; exactly 0 where both are."""
    one, zero = wp.float64(1.0), wp.float64(0.0)
    c, s = wp.cos(tilt), wp.sin(tilt)
    d, t = wp.cos(yaw), wp.sin(yaw)
    return wp.mat33d(d - one, -t * c, t * s, t, d * c - one, -d * s, zero, s, c - one)


@wp.func
def estimate(data: PerceptionData, truth: TruthData, row: PerceptionRow, world: int, slot: int, frame: int, first: int):
    """Make an estimate of a picture [µm]: each robot is shifted, and turned about the middle of its spheres."""
    for robot in range(data.robots):
        error = err(data, row, world, robot, frame, first)
        turn = turn_less_one(error[3], error[4])
        shift = wp.vec3d(error[0], error[1], error[2])
        middle, count = wp.vec3d(), wp.float64(0.0)
        for s in range(data.robot.shape[0]):
            if data.robot[s] == robot:
                middle += truth.sphere[world, s]
                count += wp.float64(1.0)
        middle = middle / wp.max(count, wp.float64(1.0))
        for s in range(data.robot.shape[0]):
            if data.robot[s] == robot:
                place = truth.sphere[world, s]
                data.sphere[world, slot, s] = place + (shift + turn * (place - middle))


@wp.func
def lag_of(data: PerceptionData, truth: TruthData, row: PerceptionRow, world: int, slot: int) -> wp.float64:
    """Largest distance of a held sphere from its trap in an estimate [µm]."""
    if row.exact != 0:
        return truth.sight.lag[world]
    lag = wp.float64(0.0)
    for t in range(data.held.shape[0]):
        if data.held[t] >= 0:
            place = data.sphere[world, slot, data.held[t]]
            lag = wp.max(lag, wp.length(place - (truth.trap[world, t] + data.point[t])))
    return lag


@wp.func
def look(truth: TruthData, sight: SightData, world: int, lag: wp.float64):
    """Let the eyes have a picture, in which a sphere is at most so far from its trap [µm]."""
    for h in range(sight.error.shape[1]):
        sight.error[world, h] = truth.sight.error[world, h]
    sight.lag[world] = lag


@wp.func
def take(data: PerceptionData, truth: TruthData, sight: SightData, row: PerceptionRow, world: int, frame: int,
         tick: int, first: int):  # fmt: skip
    """Take a picture at the end of a period, and put the estimate, if one is made of it, on its way [µm]."""
    slot = data.taken[world] % data.tick.shape[1]
    estimate(data, truth, row, world, slot, frame, first)
    if is_lost(data, row, frame):
        return
    for t in range(data.held.shape[0]):
        data.trap[world, slot, t] = truth.trap[world, t]
        data.power[world, slot, t] = truth.power[world, t]
    data.tick[world, slot] = tick
    data.taken[world] = data.taken[world] + 1
    if row.twin != 0:
        look(truth, sight, world, lag_of(data, truth, row, world, slot))


@wp.func
def serve(data: PerceptionData, truth: TruthData, served: ServedData, row: PerceptionRow, world: int, now: int):
    """Give the chain the newest estimate [µm] that is at least its delay old, if it is a new one."""
    places = data.tick.shape[1]
    taken, newest = data.taken[world], int(-1)
    next = wp.max(data.served[world], taken - places)
    while next < taken and data.tick[world, next % places] + row.delay <= now:
        newest = next % places
        next = next + 1
    data.served[world] = next
    served.fresh[world] = newest >= 0
    if newest < 0:
        return
    for s in range(data.robot.shape[0]):
        served.sphere[world, s] = data.sphere[world, newest, s]
    for t in range(data.held.shape[0]):
        place = data.trap[world, newest, t]
        if row.stamped == 0:
            place = truth.trap[world, t]
        served.trap[world, t] = place
        served.power[world, t] = data.power[world, newest, t]
    served.time[world] = wp.float64(data.tick[world, newest]) / data.rate


@wp.kernel(enable_backward=False)
def begin_perception(data: PerceptionData, truth: TruthData, served: ServedData, sight: SightData):
    """The pictures of the scene that stood still before the start, over worlds."""
    world = wp.tid()
    row = data.rows[world]
    count = int(wp.ceil(data.before * row.frame_rate))
    for n in range(count + 1):
        frame = n - count
        take(data, truth, sight, row, world, frame, due(frame, data.rate, row.frame_rate), wp.where(n == 0, 1, 0))
    data.frame[world] = 1
    data.eye_frame[world] = 1
    if row.twin == 0:
        look(truth, sight, world, truth.sight.lag[world])
    serve(data, truth, served, row, world, 0)


@wp.kernel(enable_backward=False)
def perceive(
    data: PerceptionData, truth: TruthData, served: ServedData, sight: SightData, done: wp.array(dtype=wp.int32)
):
    """The end of a servo period of each world in motion: pictures that are due, estimates that have come."""
    world = wp.tid()
    served.fresh[world] = False
    if done[world] != 0:
        return
    row = data.rows[world]
    now = data.now[world] + 1
    data.now[world] = now
    served.now[world] = wp.float64(now) / data.rate
    frame, eye_frame = data.frame[world], data.eye_frame[world]
    if now == due(frame, data.rate, row.frame_rate):
        take(data, truth, sight, row, world, frame, now, 0)
        data.frame[world] = frame + 1
    if now == due(eye_frame, data.rate, data.eye_rate):
        if row.twin == 0:
            look(truth, sight, world, truth.sight.lag[world])
        data.eye_frame[world] = eye_frame + 1
    serve(data, truth, served, row, world, now)
