"""How velocities that arrive as messages move traps: each holds until the next, and a pair moves as one rigid body."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Sequence

from otwarp.haptics.core import ZERO, Vec3

Group = Sequence[Vec3]
"""Foci of the traps of one group [µm]."""
MOST_WAITING = 8192
"""Messages kept between two readings: four seconds of a device node at 2 kHz."""


class VelocityHold:
    """Integral of a velocity given at irregular times: zero-order hold with a timeout.

    Messages come in one thread, readings in another. Times are those of one monotonic clock.

    Args:
        timeout: How long a velocity holds without a newer one [s]; zero after it.
        fastest: Speeds above it are refused, in the units of the messages.

    Attributes:
        refused: Messages that were not finite, or too fast.
    """

    def __init__(self, timeout: float, fastest: float = math.inf) -> None:
        self._timeout, self._fastest = timeout, fastest
        self._lock = threading.Lock()
        self._waiting: deque[tuple[float, Vec3]] = deque(maxlen=MOST_WAITING)
        self._velocity: Vec3 = ZERO
        self._until = -math.inf
        self._read: float | None = None
        self.refused = 0

    def message(self, velocity: Vec3, time: float) -> None:
        """A velocity that holds from `time` [s] on."""
        speed = math.hypot(*velocity)
        if not (speed <= self._fastest and speed < math.inf):
            self.refused += 1
            return
        with self._lock:
            self._waiting.append((time, velocity))

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


def centroid(points: Group) -> Vec3:
    """Mean of points (n, 3), n ≥ 1."""
    n = len(points)
    return (sum(p[0] for p in points) / n, sum(p[1] for p in points) / n, sum(p[2] for p in points) / n)


def midpoint(a: Vec3, b: Vec3) -> Vec3:
    """The point halfway between two points, in their unit."""
    return ((a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0, (a[2] + b[2]) / 2.0)


def move_pair(first: Group, second: Group, shift: tuple[float, float], angle: float) -> tuple[list[Vec3], list[Vec3]]:
    """Both groups turned about the vertical through their midpoint and moved in the plane, as one rigid body.

    p' = m + R(angle)·(p − m) + shift in x and y, m halfway between the groups' centroids; z stays.

    Args:
        first, second: Foci of each group (n, 3) [µm], n ≥ 1.
        shift: In the plane [µm].
        angle: From x towards y [rad].

    Returns:
        The groups' new foci.
    """
    mx, my, _ = midpoint(centroid(first), centroid(second))
    c, s = math.cos(angle), math.sin(angle)

    def _moved(p: Vec3) -> Vec3:
        x, y = p[0] - mx, p[1] - my
        return (mx + c * x - s * y + shift[0], my + s * x + c * y + shift[1], p[2])

    return [_moved(p) for p in first], [_moved(p) for p in second]
