"""A hand that a deflection moves: what sticks and caps say is a velocity, and the hand's place is its integral."""

from __future__ import annotations

import math

from otwarp.haptics.core.types import ZERO, Vec3

LONGEST_STEP = 0.1
"""Seconds of movement that one reading may catch up: a loop that was stopped must not make the hand leap."""
BELOW = 1.0 - 1e-12
"""Shortens a step at full deflection, so that rounding leaves it within the full speed."""


class RateHand:
    """The place of a hand whose velocity is a deflection.

    v = speed·s, s_i = sign(d_i)·(|d_i| − z)/(1 − z) beyond the dead zone z and 0 within, d clamped to ±1, and |s| to 1.
    The deflection is held from one reading to the next.

    Args:
        speed: At full deflection, in any direction [m/s].
        dead_zone: Part of the full deflection, per axis, that counts as none.

    Attributes:
        position: Since it was made [m].
    """

    __slots__ = ("_dead_zone", "_gain", "_speed", "_time", "_velocity", "position")

    def __init__(self, speed: float, dead_zone: float):
        self._speed, self._dead_zone, self._gain = speed, dead_zone, 1.0 / (1.0 - dead_zone)
        self._time = -math.inf
        self._velocity: Vec3 = ZERO
        self.position: Vec3 = ZERO

    def stop(self) -> None:
        """Stand still until the next deflection, however long that takes."""
        self._time, self._velocity = -math.inf, ZERO

    def move(self, time: float, deflection: Vec3) -> Vec3:
        """The place at `time` [s] on the way so far; from then on the deflection (parts of full, ±1) moves it."""
        elapsed = time - self._time
        if 0.0 < elapsed < math.inf:
            elapsed = elapsed if elapsed < LONGEST_STEP else LONGEST_STEP
            (x, y, z), (u, v, w) = self.position, self._velocity
            self.position = (x + u * elapsed, y + v * elapsed, z + w * elapsed)
        self._time = time
        self._velocity = self._shaped(*deflection)
        return self.position

    def _shaped(self, x: float, y: float, z: float) -> Vec3:
        """Velocity [m/s] of a deflection."""
        x, y, z = self._beyond(x), self._beyond(y), self._beyond(z)
        square = x * x + y * y + z * z
        k = self._speed * BELOW
        if square > 1.0:
            k /= math.sqrt(square)
        return k * x, k * y, k * z

    def _beyond(self, d: float) -> float:
        """What of a deflection lies beyond the dead zone, of what can."""
        size = abs(d)
        if size <= self._dead_zone:
            return 0.0
        beyond = (min(size, 1.0) - self._dead_zone) * self._gain
        return beyond if d > 0.0 else -beyond
