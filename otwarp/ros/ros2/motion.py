"""Planar motion of the pair of trap groups."""

from __future__ import annotations

import math
from collections.abc import Sequence

from otwarp.haptics.core.types import Vec3

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
