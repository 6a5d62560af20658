"""Linear interpolation of time samples, held constant outside; times in float64 so that long runs stay exact."""

import warp as wp


@wp.func
def find_key(times: wp.array(dtype=wp.float64), first: int, last: int, time: wp.float64) -> int:
    """Index i in [first, last - 1] with times[i] ≤ time < times[i + 1] (clamped), by bisection; last > first."""
    low = first
    high = last
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= time:
            low = middle
        else:
            high = middle
    return low


@wp.func
def key_weight(times: wp.array(dtype=wp.float64), key: int, time: wp.float64) -> wp.float32:
    """Weight of key + 1 at `time`, clamped to [0, 1]."""
    weight = wp.float32((time - times[key]) / (times[key + 1] - times[key]))
    return wp.clamp(weight, 0.0, 1.0)
