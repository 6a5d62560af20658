"""Planar motion of the pair of trap groups, and a velocity that counts until it is too old."""

from __future__ import annotations

import math
from collections.abc import Sequence

from otwarp.haptics.types import Vec3

Group = Sequence[Vec3]
"""Foci of the traps of one group [µm]."""


def centroid(points: Group) -> Vec3:
    """Mean of points (n, 3), n ≥ 1."""
    n = len(points)
    return (sum(p[0] for p in points) / n, sum(p[1] for p in points) / n, sum(p[2] for p in points) / n)


def middle(a: Vec3, b: Vec3) -> Vec3:
    """Halfway between two points."""
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
    mx, my, _ = middle(centroid(first), centroid(second))
    c, s = math.cos(angle), math.sin(angle)

    def _moved(p: Vec3) -> Vec3:
        x, y = p[0] - mx, p[1] - my
        return (mx + c * x - s * y + shift[0], my + s * x + c * y + shift[1], p[2])

    return [_moved(p) for p in first], [_moved(p) for p in second]


class HeldVelocity:
    """The last velocity that was sent, which counts for a time and then no more.

    Args:
        timeout: How long it counts after it came [s].
    """

    def __init__(self, timeout: float):
        self._timeout = timeout
        self._value: Vec3 = (0.0, 0.0, 0.0)
        self._came = -math.inf

    def hold(self, value: Vec3, now: float) -> None:
        """Take a velocity that came at this time."""
        self._value, self._came = value, now

    def drop(self) -> None:
        """Forget it: zero from now on."""
        self._came = -math.inf

    def at(self, now: float) -> Vec3:
        """The velocity that counts at this time."""
        return self._value if now - self._came < self._timeout else (0.0, 0.0, 0.0)

    def between(self, last: float, now: float) -> Vec3:
        """How far it leads from one time to another, of which the velocity counts for the part before its timeout."""
        span = min(now, self._came + self._timeout) - max(last, self._came)
        if not span > 0.0:
            return (0.0, 0.0, 0.0)
        vx, vy, vz = self._value
        return (vx * span, vy * span, vz * span)
