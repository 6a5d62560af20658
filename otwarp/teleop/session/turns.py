"""When turns of a live loop begin: evenly, or with an image that would wait for the next one."""

from __future__ import annotations

from collections.abc import Callable

from otwarp.haptics.core.realtime import Clock, next_deadline

LINGER = 0.5
"""Part of the time between two turns by which one may begin later, with an image."""


def next_turn(
    clock: Clock, last: float, rate: float, await_news: Callable[[float], bool] | None, longest: float
) -> tuple[float, int]:
    """Wait until the next turn begins.

    Args:
        clock: By which the loop runs.
        last: When the last one began, or was to begin [s].
        rate: Turns per second that the loop aims at [1/s].
        await_news: See `Perception.await_news`; None where nothing is seen.
        longest: Time from turn to turn that forces bear [s].

    Returns:
        When it begins [s], and how many beats had passed already.
    """
    period = 1.0 / rate
    beat, missed = next_deadline(last, period, clock.now())
    if await_news is not None:
        # an image that comes between two beats would wait: a turn begins with it, but no sooner than after a period
        first = beat - missed * period
        clock.sleep_until(first)
        if await_news(max(beat, first + min(LINGER * period, longest - period))):
            return clock.now(), missed
    clock.sleep_until(beat)
    return beat, missed
