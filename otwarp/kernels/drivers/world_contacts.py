"""Contacts of a world of few bodies: found once a step, solved in each stage, and reported."""

import warp as wp

from otwarp.kernels.contact.blocks import block_count
from otwarp.kernels.contact.body_solve import (
    MAX_POINTS,
    SpaceRoom,
    nodes_of,
    settling_team,
    solve_bodies_term,
)
from otwarp.kernels.contact.contact import UNSETTLED
from otwarp.kernels.contact.contact_list import ContactList, solved_term
from otwarp.kernels.contact.detect import pair_contacts_term, pair_reach_term
from otwarp.kernels.contact.detect_walls import wall_contacts_term, wall_poses_term, wall_reach_term
from otwarp.kernels.contact.few_solve import FEW, solve_few_term
from otwarp.kernels.contact.open_gaps import open_gaps_term
from otwarp.kernels.contact.point_gather import column
from otwarp.kernels.contact.point_solve import MANY, joined_term, solve_points_term
from otwarp.kernels.contact.solve import lift_gaps, solve_contacts
from otwarp.kernels.contact.travel import free_travel, thermal_reach, wander_of
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import radius_of
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.team import first_of, team_of
from otwarp.kernels.core.types import ModelData, Move, Pose, ReadoutData
from otwarp.kernels.drivers.world_room import BodyRoom, CarryRoom, ContactRoom, Found
from otwarp.kernels.integrate.integrators import INTEGRATORS

PUSHED = wp.constant(0.1)
"""How far one body pushes another beyond its own free move in one step at most, relative to its bounding sphere."""


@wp.func
def bounded(bodies: int, body: BodyRoom) -> bool:
    """Whether all free moves [µm, rad] are finite and of a size that a scene can have."""
    good = bool(True)
    for b in range(bodies):
        good = good and finite(body.linear[b]) and finite(body.angular[b])
    return good


def find_contacts_term(f: Features) -> wp.Function:
    """`find` of `Stages`.

    A gap is a contact if the free moves of its bodies may close it, others pushing as far as the farthest of them, or
    if its path may touch in between.
    """
    find_at_walls = find_at_walls_term(f) if f.obstacles else None
    find_pairs = find_pairs_term(f) if f.pairs else None
    each = column(f.bodies)

    @wp.func
    def find_contacts(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, room: ContactRoom, carry: CarryRoom,
        step: wp.int64, time: wp.float64,
    ) -> Found:  # fmt: skip
        """Contacts of all bodies with obstacles and with each other, listed in `room`."""
        bodies = int(wp.static(f.bodies))
        found = Found()
        farthest = float(0.0)
        travel = each()
        wander = each()
        for a in range(bodies):
            travel[a] = free_travel(model, a, Move(body.linear[a], body.angular[a]))
            farthest = wp.max(farthest, travel[a])
            if wp.static(f.brownian):
                wander[a] = wander_of(model, world, a)
        if wp.static(bool(f.obstacles)):
            found = find_at_walls(
                model, readout, world, body, farthest, travel, wander, room.listed, found, step, time
            )  # fmt: skip
        if wp.static(f.pairs):
            found = find_pairs(model, readout, world, body, farthest, travel, wander, room.listed, found, step)
        return found

    return find_contacts


def take_found_term(f: Features) -> wp.Function:
    """`(model, found, count, a, b) -> Found` with the contacts of bodies a and b, −1 for an obstacle."""
    joined = joined_term(f) if in_points(f) else None

    @wp.func
    def take_found(model: ModelData, found: Found, count: int, a: int, b: int) -> Found:
        """What was found once there are `count` contacts [1]."""
        if wp.static(joined is not None):
            if count > found.count:
                found.partners = joined(model, found.partners, a, b)
        found.count = count
        return found

    return take_found


def find_at_walls_term(f: Features) -> wp.Function:
    """`(model, readout, world, body, farthest, travel, wander, listed, found, step, time) -> Found`: with obstacles."""
    team = team_of(f)
    size_of, lane_of, votes_of, value_of, bits_of = team.size, team.lane, team.votes, team.value, team.bits
    wall_poses, wall_reach, wall_contacts = wall_poses_term(f), wall_reach_term(f), wall_contacts_term(f)
    take_found = take_found_term(f)
    each = column(f.bodies)

    @wp.func
    def find_at_walls(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, farthest: float,
        travel: each, wander: each, listed: ContactList, found: Found, step: wp.int64, time: wp.float64,
    ) -> Found:  # fmt: skip
        """What was found by then. Obstacle by obstacle, so that each is looked for in its key frames once."""
        position = body.position
        rotation = body.rotation
        bodies = int(wp.static(f.bodies))
        obstacles = model.obstacles.shape.shape[0]
        reach = each()
        for first in range(0, obstacles, size_of()):
            # an obstacle for each thread of the team, then all of them together for those that a body is near
            o = wp.min(first + lane_of(), obstacles - 1)
            wall, later = wall_poses(model, o, time)
            near = int(0)
            for a in range(bodies):
                pushed = wp.min(farthest, PUSHED * model.body.bound[a])
                if wp.static(f.brownian):
                    pushed = wp.max(pushed, thermal_reach(wander[a]))
                pose = Pose(position[a], rotation[a])
                reach[a] = wall_reach(model, a, o, pose, wall, later, travel[a], pushed)
                if reach[a] >= 0.0 and first + lane_of() < obstacles:
                    near = near | (1 << a)
            votes = votes_of(near != 0)
            while votes != 0:
                lane = first_of(votes)
                votes = votes & (votes - 1)
                if wp.static(f.team > 1):
                    wall, later = wall_poses(model, first + lane, time)
                for a in range(bodies):
                    if (bits_of(near, lane) >> a) & 1 != 0:
                        count = wall_contacts(
                            model, readout, world, a, first + lane, Pose(position[a], rotation[a]),
                            Move(body.linear[a], body.angular[a]), wall, later, value_of(reach[a], lane), body.free,
                            body.drift, listed, found.count, step,
                        )  # fmt: skip
                        found = take_found(model, found, count, a, -1)
        return found

    return find_at_walls


def find_pairs_term(f: Features) -> wp.Function:
    """`(model, readout, world, body, farthest, travel, wander, listed, found, step) -> Found`: between bodies."""
    team = team_of(f)
    size_of, lane_of, votes_of, value_of = team.size, team.lane, team.votes, team.value
    reach_of_pair, pair_contacts, take_found = pair_reach_term(f), pair_contacts_term(f), take_found_term(f)
    each = column(f.bodies)

    @wp.func
    def beside(model: ModelData, body: BodyRoom, a: int, b: int) -> Pose:
        """Pose of body b, or of its image, where it is nearest to body a."""
        position = body.position
        rotation = body.rotation
        pose = Pose(position[b], rotation[b])
        if wp.static(f.periodic):
            pose.position += image_shift(model.period, pose.position - position[a])
        return pose

    @wp.func
    def find_pairs(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, farthest: float,
        travel: each, wander: each, listed: ContactList, found: Found, step: wp.int64,
    ) -> Found:  # fmt: skip
        """What was found by then, body by body with those before it."""
        position = body.position
        rotation = body.rotation
        bodies = int(wp.static(f.bodies))
        for a in range(bodies):
            pose_a = Pose(position[a], rotation[a])
            move_a = Move(body.linear[a], body.angular[a])
            for first in range(0, a, size_of()):
                # as before obstacles: a body for each thread, then all of them for those that are near
                mine = first + lane_of()
                reach = float(-1.0)
                if mine < a:
                    pushed = wp.min(farthest, PUSHED * model.body.bound[a])
                    if wp.static(f.brownian):
                        pushed = wp.max(pushed, thermal_reach(wander[a] + wander[mine]))
                    reach = reach_of_pair(
                        model, a, mine, pose_a, beside(model, body, a, mine), travel[a] + travel[mine], pushed
                    )  # fmt: skip
                votes = votes_of(reach >= 0.0)
                while votes != 0:
                    lane = first_of(votes)
                    votes = votes & (votes - 1)
                    b = first + lane
                    count = pair_contacts(
                        model, readout, world, a, b, pose_a, beside(model, body, a, b), move_a,
                        Move(body.linear[b], body.angular[b]), value_of(reach, lane), body.free, body.drift, listed,
                        found.count, step,
                    )  # fmt: skip
                    found = take_found(model, found, count, a, b)
        return found

    return find_pairs


def settle_term(f: Features) -> wp.Function:
    """`settle` of `Stages`, for bodies that move by their own contacts alone."""
    return settle_moves_term(f) if f.body_space else settle_forces_term(f)


def solve_in_space_term(f: Features) -> wp.Function:
    """`solve_bodies`, with room for the matrix."""
    solve_bodies = solve_bodies_term(f)

    @wp.func
    def solve_in_space(
        model: ModelData, world: int, listed: ContactList, count: int, body: BodyRoom, again: bool,
        moved: wp.array(dtype=wp.vec3),
    ) -> float:  # fmt: skip
        """How far forces out of balance would move a body [µm]."""
        node = wp.zeros(shape=(wp.static(f.bodies + 1),), dtype=int)
        block = wp.zeros(shape=(wp.static(block_count(nodes_of(f))),), dtype=wp.mat33)
        filled = wp.zeros(shape=(wp.static(nodes_of(f)),), dtype=int)
        side = wp.zeros(shape=(wp.static(nodes_of(f)),), dtype=wp.vec3)
        return solve_bodies(
            model, world, listed, count, body.position, body.rotation, again, body.linear, body.angular,
            SpaceRoom(node, block, filled, side, moved),
        )  # fmt: skip

    return solve_in_space


def solves_many(f: Features) -> bool:
    """Whether more contacts than a few are to be solved for what they move."""
    return not f.cached or f.max_contacts > FEW


def in_points(f: Features) -> bool:
    """Whether contacts may be solved as in `point_solve`."""
    return f.body_space and solves_many(f) and f.bodies <= MAX_POINTS


def solve_moves_term(f: Features) -> wp.Function:
    """`(model, world, listed, found, body, again, moved) -> float`: solve contacts for what they move.

    For what they move one point of each body, where they all run through such; on CPUs a few for their forces.
    """
    team = settling_team(f)
    lane_of, value_of, wait = team.lane, team.value, team.wait
    solve_few = solve_few_term(f, FEW) if f.cached else None
    many, points, two_stages = solves_many(f), in_points(f), INTEGRATORS[f.integrator].correct is not None
    solve_points = solve_points_term(f) if points else None
    solve_bodies = solve_in_space_term(f) if many and (f.rigid or not points) else None

    @wp.func
    def solve_moves(
        model: ModelData, world: int, listed: ContactList, found: Found, body: BodyRoom, again: bool,
        moved: wp.array(dtype=wp.vec3),
    ) -> float:  # fmt: skip
        """How far forces out of balance would move a body [µm]; `moved` is kept between the stages."""
        error = float(0.0)
        count = found.count
        partners = int(MANY)
        if wp.static(solve_few is not None):
            if count <= FEW:
                return solve_few(model, world, listed, count, body.rotation, again, body.linear, body.angular)
        if wp.static(points):
            partners = found.partners
            if partners != MANY:
                error = solve_points(
                    model, world, listed, count, partners, body.position, body.rotation, again, body.linear,
                    body.angular, moved, wp.static(two_stages) and not again,
                )  # fmt: skip
        if wp.static(solve_bodies is not None):
            if partners == MANY:
                # by one thread, from what all of them have written
                wait()
                if lane_of() == 0:
                    error = solve_bodies(model, world, listed, count, body, again, moved)
                error = value_of(error, 0)
        return error

    return solve_moves


def settle_moves_term(f: Features) -> wp.Function:
    """`settle` of `Stages` where contacts are solved for what they move."""
    two_stages = INTEGRATORS[f.integrator].correct is not None
    open_gaps = open_gaps_term(f) if two_stages else None
    solve_moves = solve_moves_term(f)
    lane_of = settling_team(f).lane

    @wp.func
    def settle(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, room: ContactRoom, carry: CarryRoom,
        found: Found, again: bool, step: wp.int64,
    ):  # fmt: skip
        """Solve the contacts and add their moves [µm, rad]; a fault where the solution errs by over `UNSETTLED`.

        `again`: they were solved before in this step.
        """
        if found.count == 0:
            return
        # a free move without bound is the fault that `all_good` reports
        sane = bounded(int(wp.static(f.bodies)), body)
        listed = room.listed
        if wp.static(two_stages):
            if again:
                open_gaps(listed, found.count, body.linear, body.angular, body.free, body.drift)
        error = solve_moves(model, world, listed, found, body, again, room.moved)
        if error > UNSETTLED * radius_of(listed.arm_a[0]) and sane and lane_of() == 0:
            raise_fault(readout, world, listed.pair[0][0], wp.static(int(Fault.UNSETTLED)), step)

    return settle


def settle_forces_term(f: Features) -> wp.Function:
    """`settle` of `Stages` where contacts are solved for their forces."""

    @wp.func
    def settle(
        model: ModelData, readout: ReadoutData, world: int, body: BodyRoom, room: ContactRoom, carry: CarryRoom,
        found: Found, again: bool, step: wp.int64,
    ):  # fmt: skip
        """Solve the contacts and add their moves [µm, rad]; a fault where the solution errs by over `UNSETTLED`."""
        count = found.count
        if count == 0:
            return
        contacts = room.listed.whole
        sane = bounded(int(wp.static(f.bodies)), body)
        if wp.static(f.bends):
            if wp.static(f.brownian) or again:
                lift_gaps(contacts, count, body.free, body.drift)
        error = solve_contacts(
            contacts, count, body.linear, body.angular, room.solve.matrix, room.solve.gap,
            room.solve.right, room.solve.pivot, room.solve.order, room.solve.on,
        )  # fmt: skip
        if error > UNSETTLED * contacts[0].radius and sane:
            raise_fault(readout, world, contacts[0].a, wp.static(int(Fault.UNSETTLED)), step)

    return settle


def report_contacts_term(f: Features) -> wp.Function:
    """`(readout, world, listed, count)`: write what the solved contacts do to each body."""
    solved = solved_term(f)

    @wp.func
    def report_contacts(readout: ReadoutData, world: int, listed: ContactList, count: int):
        """Net contact force and sum of |normal forces| [pN] of every body."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            force = wp.vec3(0.0)
            load = float(0.0)
            for i in range(count):
                c = solved(listed, i)
                if c.a == b:
                    force += c.load * c.normal
                    load += wp.abs(c.load)
                if c.b == b:
                    force -= c.load * c.normal
                    load += wp.abs(c.load)
            readout.contact_force[world, b] = force
            readout.contact_load[world, b] = load

    return report_contacts
