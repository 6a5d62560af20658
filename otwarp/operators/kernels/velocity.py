"""Velocity of the hand: twin of `otwarp.haptics.chain.motion.VelocityEstimate`.

The last samples lie in a ring of a row per hand, so that none moves when one comes.
"""

import warp as wp

from otwarp.haptics.chain.motion import AT_ONCE, LONGEST_WINDOW
from otwarp.operators.kernels.features import ChainFeatures


@wp.struct
class VelocityState:
    """Of one hand of one world."""

    velocity: wp.vec3d  # newest estimate [m/s]
    count: wp.int32  # samples that are remembered
    newest: wp.int32  # where in the ring the last one lies


@wp.struct
class Window:
    """The samples of all hands, (W·H, `LONGEST_WINDOW`), or one each without a noise margin."""

    place: wp.array2d(dtype=wp.vec3d)  # [m]
    age: wp.array2d(dtype=wp.float64)  # [s]


@wp.func
def slope(window: Window, n: int, state: VelocityState, axis: int, x: wp.float64, quantum: wp.float64) -> wp.float64:
    """Slope [m/s] of one axis of hand n that is at x [m], over the longest window within ±quantum [m] of a line."""
    low = wp.float64(-wp.inf)
    high = wp.float64(wp.inf)
    found = wp.float64(0.0)
    for back in range(state.count):
        at = state.newest - back
        if at < 0:
            at += wp.static(LONGEST_WINDOW)
        age = window.age[n, at]
        to = window.place[n, at]
        one = (x - to[axis]) / age
        if not (low <= one and one <= high):
            break
        found = one
        margin = quantum / age
        low = wp.max(low, one - margin)
        high = wp.min(high, one + margin)
    return found


def estimating(features: ChainFeatures) -> wp.Function:
    """`(window, n, state, place, elapsed, period, quantum) -> state`: the velocity with a new sample."""

    @wp.func
    def estimate(
        window: Window, n: int, state: VelocityState, place: wp.vec3d, elapsed: wp.float64, period: wp.float64,
        quantum: wp.float64,
    ) -> VelocityState:  # fmt: skip
        """Velocity [m/s] of hand n at a place [m], `elapsed` [s] after the last sample."""
        out = state
        if elapsed >= wp.static(wp.float64(AT_ONCE)) * period:
            if wp.static(features.windowed):
                for at in range(state.count):
                    window.age[n, at] = window.age[n, at] + elapsed
                out.velocity = wp.vec3d(
                    slope(window, n, state, 0, place[0], quantum),
                    slope(window, n, state, 1, place[1], quantum),
                    slope(window, n, state, 2, place[2], quantum),
                )
                if state.count > 0:
                    # the first lies at 0, so that the samples there are always fill the ring's beginning
                    out.newest = (state.newest + 1) % wp.static(LONGEST_WINDOW)
                out.count = wp.min(state.count + 1, wp.static(LONGEST_WINDOW))
                window.place[n, out.newest] = place
                window.age[n, out.newest] = wp.float64(0.0)
            else:
                if state.count > 0:
                    out.velocity = (place - window.place[n, 0]) / elapsed
                out.count = 1
                window.place[n, 0] = place
        return out

    return estimate
