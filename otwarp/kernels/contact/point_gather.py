"""What one of Newton's steps of `point_solve` takes: a matrix and right-hand sides, gathered from all contacts."""

from typing import Any

import warp as wp

from otwarp.kernels.contact.body_solve import settling_team
from otwarp.kernels.contact.contact_list import ContactList, entry_at, keep_depth, law_of, opened_by
from otwarp.kernels.contact.implicit_law import DEPTH_ROUNDS, DEPTH_TOLERANCE, Line, line_of
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import point_of
from otwarp.kernels.core.team import ALONE
from otwarp.kernels.cpu.law_block import sum_lines_term


def table(rows: int, columns: int) -> Any:
    """Type of a matrix of so many rows and columns."""
    return wp.types.matrix(shape=(rows, columns), dtype=wp.float32)


def column(rows: int) -> Any:
    """Type of a vector of so many numbers."""
    return wp.types.vector(length=rows, dtype=wp.float32)


def way_of_pair_term(f: Features) -> wp.Function:
    """`(moved, pair) -> way`: how far the points of two bodies move apart [µm]; an obstacle's does not move."""
    bodies, long = f.bodies, column(3 * f.bodies)

    @wp.func
    def way_of_pair(moved: long, pair: wp.vec2i) -> wp.vec3:
        """The way [µm]: chosen, not indexed, since what is written out by constants stays in registers."""
        way = wp.vec3(0.0)
        for k in range(wp.static(bodies)):
            sign = wp.where(pair[0] == k, 1.0, wp.where(pair[1] == k, -1.0, 0.0))
            for r in range(3):
                way[r] += sign * moved[3 * k + r]
        return way

    return way_of_pair


def system_terms(f: Features) -> tuple[wp.Function, wp.Function]:
    """`(drags, moved) -> (system, right)` without contacts, and
    `(system, right, pair, stiffness, force) -> (system, right)` with those of two bodies more.

    Of the matrix what is on and below the diagonal counts.
    """
    bodies = f.bodies
    matrix, blocks, long = table(3 * bodies, 3 * bodies), table(3 * bodies, 3), column(3 * bodies)

    @wp.func
    def resisted(drags: blocks, moved: long):
        """Matrix [pN/µm] and right-hand side [pN] of points that only their drags hold."""
        system = matrix()
        right = long()
        for k in range(wp.static(bodies)):
            for r in range(3):
                for c in range(3):
                    system[3 * k + r, 3 * k + c] = drags[3 * k + r, c]
                    right[3 * k + r] -= drags[3 * k + r, c] * moved[3 * k + c]
        return system, right

    @wp.func
    def with_pair(system: matrix, right: long, pair: wp.vec2i, stiffness: wp.mat33, force: wp.vec3):
        """The same with the summed slope [pN/µm] and force [pN] of all contacts of a pair."""
        for k in range(wp.static(bodies)):
            sign = wp.where(pair[0] == k, 1.0, wp.where(pair[1] == k, -1.0, 0.0))
            for r in range(3):
                right[3 * k + r] += sign * force[r]
                for c in range(3):
                    system[3 * k + r, 3 * k + c] += sign * sign * stiffness[r, c]
            for j in range(k):
                both = wp.where(pair[0] == k and pair[1] == j, 1.0, 0.0)
                for r in range(3):
                    for c in range(3):
                        system[3 * k + r, 3 * j + c] -= both * stiffness[r, c]
        return system, right

    return resisted, with_pair


def gather_points_term(f: Features) -> wp.Function:
    """`(listed, count, first, drags, moved) -> (system, right)` of one of Newton's steps."""
    bodies, team, way_of_pair = f.bodies, settling_team(f), way_of_pair_term(f)
    size_of, lane_of, value_of, bits_of, alone = team.size, team.lane, team.value, team.bits, team is ALONE
    blocks, long = table(3 * bodies, 3), column(3 * bodies)
    resisted, with_pair = system_terms(f)

    @wp.func
    def gather_points(listed: ContactList, count: int, first: bool, drags: blocks, moved: long):
        """Matrix and right-hand sides at the moves of the points [µm], which `drags` [pN/µm] resist.

        Each thread of a team works out another contact; then all of them add up all, in the order of the list.
        Neighbours of the same two bodies go together.
        """
        system, right = resisted(drags, moved)
        i = int(0)
        line = Line()
        way = wp.vec3(0.0)
        entry = entry_at(listed, 0)
        ahead = entry_at(listed, wp.min(lane_of(), count - 1))
        pair = entry.pair
        while i < count:
            if wp.static(alone):
                way = way_of_pair(moved, pair)
            stiffness = wp.mat33(0.0)
            force = wp.vec3(0.0)
            joined = bool(True)
            while joined:
                lane = i % size_of()
                if lane == 0:
                    # read before these are worked out: the memory of a GPU is far away
                    entry = ahead
                    ahead = entry_at(listed, wp.min(i + size_of() + lane_of(), count - 1))
                    if wp.static(not alone):
                        way = way_of_pair(moved, entry.pair)
                    opening = opened_by(entry.face) + wp.dot(way, point_of(entry.face))
                    line = line_of(law_of(entry.law, entry.path), opening, entry.depth, first)
                    if i + lane_of() < count:
                        keep_depth(listed, i + lane_of(), line.depth)
                own = point_of(entry.face)
                n = wp.vec3(value_of(own[0], lane), value_of(own[1], lane), value_of(own[2], lane))
                stiffness = stiffness + wp.outer(value_of(line.slope, lane) * n, n)
                force = force + value_of(line.load, lane) * n
                i += 1
                lane = i % size_of()
                following = entry.pair
                if lane == 0:
                    following = ahead.pair
                following = wp.vec2i(bits_of(following[0], lane), bits_of(following[1], lane))
                joined = i < count and following == pair
            system, right = with_pair(system, right, pair, stiffness, force)
            pair = following
        return system, right

    return gather_points


def gather_lanes_term(f: Features) -> wp.Function:
    """`gather_points` in the vector registers of a CPU: all contacts of two bodies at once."""
    bodies, way_of_pair = f.bodies, way_of_pair_term(f)
    sum_lines = sum_lines_term(DEPTH_ROUNDS, DEPTH_TOLERANCE)
    blocks, long = table(3 * bodies, 3), column(3 * bodies)
    resisted, with_pair = system_terms(f)

    @wp.func
    def gather_lanes(listed: ContactList, count: int, first: bool, drags: blocks, moved: long):
        """Matrix and right-hand sides at the moves of the points [µm], which `drags` [pN/µm] resist."""
        system, right = resisted(drags, moved)
        i = int(0)
        while i < count:
            pair = listed.pair[i]
            end = i + 1
            while end < count and listed.pair[wp.min(end, count - 1)] == pair:
                end += 1
            way = way_of_pair(moved, pair)
            s = sum_lines(listed.face, listed.law, listed.path, listed.depth, i, end, way, first)
            stiffness = wp.mat33(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5])
            system, right = with_pair(system, right, pair, stiffness, wp.vec3(s[6], s[7], s[8]))
            i = end
        return system, right

    return gather_lanes


def gather_term(f: Features) -> wp.Function:
    """`gather_points`, or what a CPU has in its place."""
    return gather_lanes_term(f) if f.cached and f.precision == "float32" else gather_points_term(f)
