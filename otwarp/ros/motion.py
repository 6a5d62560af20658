"""Displacement from velocities that arrive as messages: each holds until the next, and no longer than a timeout."""

from __future__ import annotations

import math
import threading
from collections import deque

from otwarp.haptics.core.types import ZERO, Vec3

MOST_WAITING = 8192
"""Messages kept between two readings: four seconds of a device node at 2 kHz."""


class VelocityHold:
    """Integral of a velocity given at irregular times.

    Messages come in one thread, readings in another. Times are those of one monotonic clock.

    Args:
        timeout: How long a velocity holds without a newer one [s]; zero after it.
        fastest: Speeds above it are refused, in the units of the messages.

    Attributes:
        refused: Messages that were not finite, or too fast.
        heard: Time of the newest message [s], −inf before the first.
    """

    def __init__(self, timeout: float, fastest: float = math.inf) -> None:
        self._timeout, self._fastest = timeout, fastest
        self._lock = threading.Lock()
        self._waiting: deque[tuple[float, Vec3]] = deque(maxlen=MOST_WAITING)
        self._velocity: Vec3 = ZERO
        self._until = -math.inf
        self._read: float | None = None
        self.refused, self.heard = 0, -math.inf

    def message(self, velocity: Vec3, time: float) -> None:
        """A velocity that holds from `time` [s] on."""
        speed = math.hypot(*velocity)
        if not (speed <= self._fastest and speed < math.inf):
            self.refused += 1
            return
        with self._lock:
            self._waiting.append((time, velocity))
            self.heard = time

    def drop(self) -> None:
        """Forget every velocity, and when it was last read: zero from now on."""
        with self._lock:
            self._waiting.clear()
        self._velocity, self._until, self._read = ZERO, -math.inf, None

    def at(self, now: float) -> Vec3:
        """The velocity that holds at this time [s], of those that have come."""
        with self._lock:
            waiting = [(velocity, time + self._timeout) for time, velocity in self._waiting if time <= now]
        velocity, until = waiting[-1] if waiting else (self._velocity, self._until)
        return velocity if now < until else ZERO

    def displacement(self, now: float) -> Vec3:
        """∫ v dt since the last reading; the first one starts the count and is zero."""
        with self._lock:
            waiting = list(self._waiting)
            self._waiting.clear()
        at = now if self._read is None else self._read
        x = y = z = 0.0
        for time, velocity in (*waiting, (now, None)):
            # a message may be stamped a little later than `now`, by the other thread
            time = min(max(time, at), now)
            held = min(time, self._until) - at
            if held > 0.0:
                u, v, w = self._velocity
                x, y, z = x + u * held, y + v * held, z + w * held
            at = max(at, time)
            if velocity is not None:
                self._velocity, self._until = velocity, time + self._timeout
        self._read = at
        return (x, y, z)
