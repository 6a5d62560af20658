"""Where a segment comes nearest to a shape: the points of a rod at which contacts are to be listed.

Along a segment the distance to a convex shape is a convex function f, and its slope is the cosine between the rod and
the outward normal. So the nearest point lies where the slope changes sign. A rod that lies flat on a face or along
another rod has a whole valley of nearest points; contacts at both ends of the valley hold it without rocking. A valley
is therefore given by three points: where the slope rises above −`VALLEY_SLOPE`, above 0, and above `VALLEY_SLOPE`. They
are found by halving, to 2⁻²⁰ of the length, in which f errs by second order only. The outer two are then moved to the
foot of the perpendicular from the surface point they see: exactly over the edge or tip where the valley ends.

A mesh need not be convex: its rods are halved within `MESH_PIECES` pieces, and a hollow that is narrower than a piece
can be missed where f is concave.
"""

import warp as wp

from otwarp.kernels.contact.obstacles import SHAPES
from otwarp.kernels.core.packed import distance_of, point_of
from otwarp.kernels.core.types import ObstacleData

VALLEY_SLOPE = wp.constant(0.1)
"""Slope up to which a rod lies flat: the largest turn in one step, so that the far end cannot come down unseen."""

FLAT = wp.constant(1.0e-4)
"""Slope that counts as none: above the rounding of float32 normals, and 10⁻⁸ of the radius of curvature in depth."""

MERGE = wp.constant(0.5)
"""Distance along a rod, relative to its radius, within which two points of a valley are one contact."""

HALVINGS = wp.constant(21)
"""Halvings of t in [−1, 1]: down to 2⁻²⁰."""

MESH_PIECES = wp.constant(8)
"""Pieces into which a rod is divided before a mesh."""

_MESH = wp.constant(SHAPES["mesh"][0])


@wp.struct
class Segment:
    """The axis of a rod, centre ± half [µm]; a sphere has half = 0."""

    centre: wp.vec3
    half: wp.vec3


@wp.struct
class Valley:
    """The t of centre + t·half where a piece of f is flat or least; flag 0: that point is not in the piece."""

    low: float
    least: float
    high: float
    begins: int
    bottom: int
    ends: int


@wp.func
def place_on(rod: Segment, t: float) -> wp.vec3:
    """Point [µm] of a segment at t in [−1, 1], from its middle at t = 0."""
    return rod.centre + t * rod.half


@wp.func
def nearest_t(rod: Segment, point: wp.vec3) -> float:
    """t in [−1, 1] of the point of a segment that is nearest to `point`; 0 for a sphere."""
    square = wp.dot(rod.half, rod.half)
    t = float(0.0)
    if square > 0.0:
        t = wp.clamp(wp.dot(point - rod.centre, rod.half) / square, -1.0, 1.0)
    return t


def obstacle_slope_term(distance_to: wp.Function) -> wp.Function:
    """`(obstacles, o, other, rod, t, reach) -> (slope, distance)` of an obstacle; the rod is in its frame."""

    @wp.func
    def obstacle_slope(
        obstacles: ObstacleData, o: int, other: Segment, rod: Segment, t: float, reach: float
    ) -> wp.vec2:  # fmt: skip
        """Cosine between the outward normal and the rod, and the distance [µm]."""
        hit = distance_to(obstacles, o, place_on(rod, t), reach)
        return wp.vec2(wp.dot(point_of(hit), rod.half) / wp.length(rod.half), distance_of(hit))

    return obstacle_slope


@wp.func
def segment_slope(obstacles: ObstacleData, o: int, other: Segment, rod: Segment, t: float, reach: float) -> wp.vec2:
    """Slope of the distance to the axis of `other`, and the distance [µm]; obstacles do not count."""
    point = place_on(rod, t)
    way = point - place_on(other, nearest_t(other, point))
    distance = wp.length(way)
    return wp.vec2(wp.dot(way, rod.half) / wp.max(distance * wp.length(rod.half), 1.0e-30), distance)


def crossing_term(slope_of: wp.Function) -> wp.Function:
    """`(obstacles, o, other, rod, low, high, level, reach) -> t` where the slope of a rod reaches a level."""

    @wp.func
    def crossing(
        obstacles: ObstacleData, o: int, other: Segment, rod: Segment, low: float, high: float, level: float,
        reach: float,
    ) -> float:  # fmt: skip
        """t in [low, high] by bisection; the slope is below `level` at low and not at high."""
        a = float(low)
        b = float(high)
        for _ in range(HALVINGS):
            t = 0.5 * (a + b)
            if slope_of(obstacles, o, other, rod, t, reach)[0] < level:
                a = t
            else:
                b = t
        return b

    return crossing


def foot_term(slope_of: wp.Function) -> wp.Function:
    """`(obstacles, o, other, rod, t, reach) -> t` of the perpendicular from the surface point that a rod sees at t."""

    @wp.func
    def foot(obstacles: ObstacleData, o: int, other: Segment, rod: Segment, t: float, reach: float) -> float:
        """t in [−1, 1] of the foot on the rod."""
        seen = slope_of(obstacles, o, other, rod, t, reach)
        return wp.clamp(t - seen[0] * seen[1] / wp.length(rod.half), -1.0, 1.0)

    return foot


def valley_term(slope_of: wp.Function) -> wp.Function:
    """`(obstacles, o, other, rod, piece, pieces, reach) -> Valley` of one piece of a rod."""
    crossing, foot = crossing_term(slope_of), foot_term(slope_of)

    @wp.func
    def valley(
        obstacles: ObstacleData, o: int, other: Segment, rod: Segment, piece: int, pieces: int, reach: float
    ) -> Valley:
        """The flat part of one piece, and which of its three points belong to this piece."""
        first = piece == 0
        last = piece == pieces - 1
        left = 2.0 * float(piece) / float(pieces) - 1.0
        right = 2.0 * float(piece + 1) / float(pieces) - 1.0
        at_left = slope_of(obstacles, o, other, rod, left, reach)[0]
        at_right = slope_of(obstacles, o, other, rod, right, reach)[0]
        v = Valley(left, left, right, 0, 0, 0)
        if at_left > VALLEY_SLOPE:
            # it rises from the start: no valley, but the end of the rod is its lowest point
            v.high = left
            v.bottom = wp.where(first, 1, 0)
        elif at_right < -VALLEY_SLOPE:
            v.low = right
            v.least = right
            v.bottom = wp.where(last, 1, 0)
        else:
            v.begins = wp.where(first or at_left < -VALLEY_SLOPE, 1, 0)
            v.ends = wp.where(last or at_right > VALLEY_SLOPE, 1, 0)
            if at_left < -VALLEY_SLOPE:
                v.low = crossing(obstacles, o, other, rod, left, right, -VALLEY_SLOPE, reach)
            if at_right > VALLEY_SLOPE:
                v.high = crossing(obstacles, o, other, rod, v.low, right, VALLEY_SLOPE, reach)
            if at_left >= -FLAT:
                v.bottom = wp.where(first, 1, 0)
            elif at_right < -FLAT:
                v.least = right
                v.bottom = wp.where(last, 1, 0)
            else:
                v.least = crossing(obstacles, o, other, rod, v.low, v.high, -FLAT, reach)
                v.bottom = 1
            if at_left < -VALLEY_SLOPE:
                v.low = foot(obstacles, o, other, rod, v.low, reach)
            if at_right > VALLEY_SLOPE:
                v.high = foot(obstacles, o, other, rod, v.high, reach)
        return v

    return valley


@wp.func
def valley_t(v: Valley, choice: int) -> float:
    """t in [−1, 1] of the three points of a valley in order: 0 where it begins, 1 its bottom, 2 where it ends."""
    t = v.least
    if choice == 0:
        t = v.low
    elif choice == 2:
        t = v.high
    return t


@wp.func
def valley_counts(v: Valley, choice: int, apart: float) -> bool:
    """Whether that point is a contact of its own: it belongs to the piece, and is not within `apart` of the bottom."""
    wanted = v.bottom != 0
    if choice == 0:
        wanted = v.begins != 0 and (v.bottom == 0 or v.least - v.low > apart)
    elif choice == 2:
        wanted = v.ends != 0 and (v.bottom == 0 or v.high - v.least > apart) and v.high - v.low > apart
    return wanted


@wp.func
def pieces_of(obstacles: ObstacleData, o: int) -> int:
    """Number of equal pieces in which a rod is searched before an obstacle: several before a mesh, else 1."""
    return wp.where(obstacles.shape[o] == _MESH, MESH_PIECES, 1)
