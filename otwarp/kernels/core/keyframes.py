"""Linear interpolation of time samples, held constant outside; times in float64 so that long runs stay exact."""

import warp as wp

from otwarp.kernels.core.types import StepTimes

SHORTEST = wp.constant(1.2e-38)
"""Time [s] between first and last sample from which on a key is guessed: less is 0 in float32, on a GPU at least."""


@wp.struct
class Piece:
    """The line between two samples of a trap's command, kept in registers while it lasts; the empty one never does.

    That of a trap which follows no samples lasts for ever.
    """

    since: wp.float64  # [s]; −inf for the first
    until: wp.float64  # [s]; inf for the last
    origin: wp.float64  # time of its first sample [s]
    rate: wp.float64  # one over the time between both [1/s]
    key: wp.int32  # index of its first sample
    follow: wp.int32  # bit 0: the focus is on the line, bit 1: the power is
    start: wp.vec4  # focus [µm] and power [mW]
    end: wp.vec4


@wp.func
def find_key(times: wp.array(dtype=wp.float64), first: int, last: int, time: wp.float64) -> int:
    """Index i in [first, last - 1] with times[i] ≤ time < times[i + 1] (clamped); last > first.

    Where samples keep equal distances it is found at once, else by bisection: each of its looks waits for the one
    before, and the memory of a GPU is far away.
    """
    low = first
    high = last
    begin = times[first]
    end = times[last]
    span = wp.float32(end - begin)
    if begin < time and time < end and span > SHORTEST:
        share = wp.float32(time - begin) / span
        guess = wp.min(first + int(share * wp.float32(last - first)), last - 1)
        if times[guess] <= time:
            low = guess
            if time < times[guess + 1]:
                high = guess + 1
        else:
            high = guess
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= time:
            low = middle
        else:
            high = middle
    return low


@wp.func
def find_key_from(times: wp.array(dtype=wp.float64), key: int, first: int, last: int, time: wp.float64) -> int:
    """The same by looking on from `key`, which a time that goes on seldom leaves far behind; by bisection if it did."""
    found = wp.max(key, first)
    if times[found] > time or (found + 1 < last and times[found + 1] <= time):
        found = wp.min(found + 1, last - 1)
        if times[found] > time or (found + 1 < last and times[found + 1] <= time):
            found = find_key(times, first, last, time)
    return found


@wp.func
def key_weight(times: wp.array(dtype=wp.float64), key: int, time: wp.float64) -> wp.float32:
    """Weight of key + 1 at `time`, clamped to [0, 1]."""
    weight = wp.float32((time - times[key]) / (times[key + 1] - times[key]))
    return wp.clamp(weight, 0.0, 1.0)


@wp.func
def sampled_value(
    times: wp.array(dtype=wp.float64), values: wp.array(dtype=wp.vec4), first: int, last: int, time: wp.float64
) -> wp.vec4:
    """Focus [µm] and power [mW] at `time` [s] by the samples `first` to `last`, at least two."""
    key = find_key(times, first, last, time)
    w = key_weight(times, key, time)
    return (1.0 - w) * values[key] + w * values[key + 1]


@wp.func
def row_at(steps: StepTimes, time: wp.float64) -> int:
    """Row of what was looked up for the step at `time` [s]."""
    return int(wp.int64(wp.rint(time * steps.per_second)) - steps.first[0])
