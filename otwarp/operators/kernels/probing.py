"""Hands of SIMULATED operators that do no task: moved in sines, or held still by an arm, or let go; and what follows.

Two sines at once along one axis, whose answers are told apart by sums over whole periods of both.
"""

import warp as wp

from otwarp.operators.kernels.arm import deviate
from otwarp.operators.kernels.types import MindData, Person

SINES = wp.constant(2)
"""Frequencies at once."""
TRACKED = wp.constant(5)
"""Servo periods between two places of a hand that are kept."""
FREE, DRIVEN = 0, 1
"""What a hand does: yields to the force, about where it was; goes as it is told."""
_DRIVEN = wp.constant(DRIVEN)


@wp.struct
class ProbeRow:
    """What the hands of a world do."""

    drive: wp.int32  # FREE or DRIVEN
    axis: wp.vec3d  # unit vector of the device along which they go
    amplitude: wp.vec2d  # of both sines [m]
    turning: wp.vec2d  # 2π·their frequencies [rad/s]


@wp.struct
class ProbeSums:
    """Sums over the periods after `first`, (W, H, …)."""

    first: wp.int32  # periods that do not count
    counted: wp.array2d(dtype=wp.int32)
    force: wp.array3d(dtype=wp.vec2d)  # (W, H, SINES) Σ f·(cos ωt, sin ωt) of the force on the hand, along the axis [N]
    reference: wp.array3d(dtype=wp.vec2d)  # the same of the force of a perfect twin [N]
    place: wp.array2d(dtype=wp.vec3d)  # Σ of where the hand is [m]
    square: wp.array2d(dtype=wp.vec3d)  # Σ of its squares [m²]
    track: wp.array3d(dtype=wp.vec3d)  # (W, H, samples) where it is after every TRACKED periods [m]


@wp.kernel(enable_backward=False)
def probe(
    rows: wp.array(dtype=ProbeRow), people: wp.array(dtype=Person), period: wp.float64, mind: MindData,
    done: wp.array(dtype=wp.int32), force: wp.array2d(dtype=wp.vec3d), hand: wp.array2d(dtype=wp.vec3d),
):  # fmt: skip
    """One servo period [s] of the hands of each world in motion, for the force [N] that was last sent."""
    world = wp.tid()
    if done[world] != 0:
        return
    row = rows[world]
    person = people[world]
    mind.tick[world] = mind.tick[world] + 1
    now = period * wp.float64(mind.tick[world])
    for h in range(hand.shape[1]):
        if row.drive == _DRIVEN:
            way = row.amplitude[0] * wp.sin(row.turning[0] * now) + row.amplitude[1] * wp.sin(row.turning[1] * now)
            hand[world, h] = way * row.axis
        else:
            away, velocity = deviate(
                person.turn, person.stiffness, force[world, h], mind.deviation[world, h], mind.velocity[world, h]
            )
            mind.deviation[world, h] = away
            mind.velocity[world, h] = velocity
            hand[world, h] = away


@wp.kernel(enable_backward=False)
def add_answer(
    rows: wp.array(dtype=ProbeRow), period: wp.float64, tick: wp.array(dtype=wp.int32),
    force: wp.array2d(dtype=wp.vec3d), reference: wp.array2d(dtype=wp.vec3d), hand: wp.array2d(dtype=wp.vec3d),
    sums: ProbeSums,
):  # fmt: skip
    """Add a servo period [s], over (worlds, hands); a world whose `tick` stands has had none."""
    w, h = wp.tid()
    counted = tick[w] - sums.first
    if counted <= sums.counted[w, h]:
        return
    sums.counted[w, h] = counted
    row = rows[w]
    f, g = wp.dot(force[w, h], row.axis), wp.dot(reference[w, h], row.axis)
    for n in range(SINES):
        turn = row.turning[n] * period * wp.float64(tick[w])
        wave = wp.vec2d(wp.cos(turn), wp.sin(turn))
        sums.force[w, h, n] = sums.force[w, h, n] + f * wave
        sums.reference[w, h, n] = sums.reference[w, h, n] + g * wave
    place = hand[w, h]
    sums.place[w, h] = sums.place[w, h] + place
    sums.square[w, h] = sums.square[w, h] + wp.cw_mul(place, place)
    sample = counted // TRACKED - 1
    if counted % TRACKED == 0 and sample < sums.track.shape[2]:
        sums.track[w, h, sample] = place
