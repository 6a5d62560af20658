"""Finding contacts between the elements of a body and the obstacles, as `detect` does between those of two bodies."""

import warp as wp

from otwarp.kernels.contact.contact import NO_CONTACT, Contact, pair_reach
from otwarp.kernels.contact.contact_list import ContactList, counted_term, put_term
from otwarp.kernels.contact.curvature import beside_rod, path_bend_term, relative_radius_term
from otwarp.kernels.contact.detect import element_term, new_contact_term
from otwarp.kernels.contact.excursion import excursion_term, obstacle_name
from otwarp.kernels.contact.obstacles import distance_term, moving_pose, pose_by_step, still_pose
from otwarp.kernels.contact.open_gaps import first_opening_term
from otwarp.kernels.contact.segments import (
    MERGE,
    Segment,
    obstacle_slope_term,
    pieces_of,
    place_on,
    valley_counts,
    valley_t,
    valley_term,
)
from otwarp.kernels.contact.travel import closing_on, free_travel, obstacle_drift, obstacle_travel, opening_of
from otwarp.kernels.core.faults import OVERLAP_LIMIT, Fault, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import curvature_of, distance_of, point_of, radius_of
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.roots import length_of
from otwarp.kernels.core.team import count_below, team_of
from otwarp.kernels.core.types import ModelData, Move, Pose, ReadoutData, vec6


def touch_wall_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, o, pose, wall, later, arm, radius, local, hit, step) -> Contact` with an obstacle."""
    new_contact = new_contact_term(f)
    relative_radius = relative_radius_term(f.obstacles)
    path_bend = path_bend_term(f.obstacles)

    @wp.func
    def touch_wall(
        model: ModelData, readout: ReadoutData, world: int, a: int, o: int, pose: Pose, wall: Pose, later: Pose,
        arm: wp.vec3, radius: float, local: wp.vec3, hit: wp.vec4, step: wp.int64,
    ) -> Contact:  # fmt: skip
        """Normal, overlap and effective radius before an obstacle; a fault where they overlap too far.

        `local` is the sphere's centre in the obstacle's frame [µm], `hit` the normal there and the distance [µm].
        """
        overlap = radius - distance_of(hit)
        if overlap > OVERLAP_LIMIT * radius:
            raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
        outward = point_of(hit)
        normal = wp.quat_rotate(wall.rotation, outward)
        relative = relative_radius(model.obstacles, o, local, outward, radius)
        c = new_contact(model, world, a, NO_CONTACT, pose, wall, arm, wp.vec3(0.0), normal, relative, overlap)
        bend = path_bend(model.obstacles, o, local, outward, radius)
        c.curvature = curvature_of(bend)
        c.ridge = wp.quat_rotate(wall.rotation, point_of(bend))
        if wp.static(f.moving_obstacles):
            # of the centre of curvature, which does not move where a ball turns about itself
            below = distance_of(hit)
            if c.curvature > 0.0:
                below += 1.0 / c.curvature - radius
            c.drift = obstacle_drift(wall, later, local - below * outward)
        return c

    return touch_wall


def rod_wall_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, o, i, pose, move, wall, later, rod, inside, reach, far, listed, count, …) -> count`.

    A rod against obstacle o: `rod` in the world and `inside` in the obstacle's frame.
    """
    touch_wall, put, excursion = touch_wall_term(f), put_term(f), excursion_term(f)
    first_opening = first_opening_term(f)
    distance_to = distance_term(f.obstacles)
    valley = valley_term(obstacle_slope_term(distance_to))

    @wp.func
    def rod_wall(
        model: ModelData, readout: ReadoutData, world: int, a: int, o: int, i: int,
        pose: Pose, move: Move, wall: Pose, later: Pose, rod: Segment, inside: Segment, reach: float, far: float,
        free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6), listed: ContactList, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """At the valley of its distance to the obstacle, piece by piece; `far` [µm]: how far a mesh answers."""
        radius = radius_of(model.contact.sphere[i])
        still = Move(wp.vec3(0.0), wp.vec3(0.0))
        merge = MERGE * radius / length_of(rod.half)
        pieces = pieces_of(model.obstacles, o)
        for piece in range(pieces):
            v = valley(model.obstacles, o, inside, inside, piece, pieces, far)
            for choice in range(3):
                if valley_counts(v, choice, merge):
                    t = valley_t(v, choice)
                    point = place_on(inside, t)
                    arm = place_on(rod, t)
                    hit = distance_to(model.obstacles, o, point, far)
                    way = wp.quat_rotate(wall.rotation, point_of(hit))
                    if distance_of(hit) < radius + reach + closing_on(move, arm, way):
                        c = touch_wall(model, readout, world, a, o, pose, wall, later, arm, radius, point, hit, step)
                        c = beside_rod(c, rod.half)
                        opening = opening_of(c, move, still)
                        c = excursion(model, world, c, opening, i, obstacle_name(o), choice, step)
                        opening = first_opening(c, opening, free, drift)
                        count = put(readout, world, listed, count, c, opening, step)
        return count

    return rod_wall


def element_wall_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, o, i, pose, move, wall, later, wanted, reach, …, listed, count, step) -> count`.

    Element i of body a against obstacle o, another one in each thread of the team, if it is `wanted`; `reach` [µm]: gap
    up to which its own move need not close it.
    """
    team = team_of(f)
    votes_of, lane_of = team.votes, team.lane
    touch_wall = touch_wall_term(f)
    put, counted, first_opening = put_term(f), counted_term(f), first_opening_term(f)
    excursion = excursion_term(f)
    element = element_term(f)
    distance_to = distance_term(f.obstacles)
    rod_wall = rod_wall_term(f) if f.rods else None

    @wp.func
    def element_wall(
        model: ModelData, readout: ReadoutData, world: int, a: int, o: int, i: int,
        pose: Pose, move: Move, wall: Pose, later: Pose, wanted: bool, reach: float, free: wp.array(dtype=vec6),
        drift: wp.array(dtype=vec6), listed: ContactList, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """A sphere at its centre, or a rod; where there are rods, a team is one thread."""
        rod = element(model, i, pose.rotation)
        radius = radius_of(model.contact.sphere[i])
        local = wp.quat_rotate_inv(wall.rotation, pose.position + rod.centre - wall.position)
        half = float(0.0)
        if wp.static(f.rods):
            half = length_of(rod.half)
        far = radius + half + reach + free_travel(model, a, move)
        still = Move(wp.vec3(0.0), wp.vec3(0.0))
        hit = distance_to(model.obstacles, o, local, far)
        near = wanted and distance_of(hit) < far and half == 0.0
        if near:
            way = wp.quat_rotate(wall.rotation, point_of(hit))
            near = distance_of(hit) < radius + reach + closing_on(move, rod.centre, way)
        votes = votes_of(near)
        if near:
            c = touch_wall(model, readout, world, a, o, pose, wall, later, rod.centre, radius, local, hit, step)
            opening = opening_of(c, move, still)
            c = excursion(model, world, c, opening, i, obstacle_name(o), 0, step)
            opening = first_opening(c, opening, free, drift)
            put(readout, world, listed, count + count_below(votes, lane_of()), c, opening, step)
        count = counted(votes, count)
        if wp.static(f.rods):
            if wanted and distance_of(hit) < far and half > 0.0:
                inside = Segment(local, wp.quat_rotate_inv(wall.rotation, rod.half))
                far += half  # so that a mesh answers everywhere along the rod
                count = rod_wall(
                    model, readout, world, a, o, i, pose, move, wall, later, rod, inside, reach, far, free, drift,
                    listed, count, step,
                )  # fmt: skip
        return count

    return element_wall


def wall_poses_term(f: Features) -> wp.Function:
    """`(model, o, time) -> (wall, later)`: pose of obstacle o now and at the end of the step from `time`."""
    pose_at = still_pose
    if f.moving_obstacles:
        pose_at = pose_by_step if f.looks_once else moving_pose

    @wp.func
    def wall_poses(model: ModelData, o: int, time: wp.float64) -> tuple[Pose, Pose]:
        """Poses [µm], equal for an obstacle of one key, which stays: no second search for it."""
        wall = pose_at(model.obstacles, o, time)
        later = wall
        if wp.static(f.moving_obstacles):
            if model.obstacles.key_start[o + 1] - model.obstacles.key_start[o] > 1:
                later = pose_at(model.obstacles, o, time + model.time_step)
        return wall, later

    return wall_poses


def wall_reach_term(f: Features) -> wp.Function:
    """`(model, a, o, pose, wall, later, travel, pushed) -> reach`, as `wall_contacts_term` takes it.

    `travel` [µm]: how far the free move of this step takes any point of the body; `pushed` [µm]: how far other contacts
    may push it on top of that.
    """
    distance_to = distance_term(f.obstacles)

    @wp.func
    def wall_reach(
        model: ModelData, a: int, o: int, pose: Pose, wall: Pose, later: Pose, travel: float, pushed: float
    ) -> float:  # fmt: skip
        """Gap [µm] up to which the body's own move need not close it; −1 for a body too far away.

        Tests the bounding spheres, then the true shape.
        """
        if wp.static(f.periodic):
            pose.position += image_shift(model.period, pose.position - wall.position)
        reach = pair_reach(model.contact, a, NO_CONTACT) + pushed
        way = pose.position - wall.position
        apart = length_of(way)
        if wp.static(f.moving_obstacles):
            if model.obstacles.key_start[o + 1] - model.obstacles.key_start[o] > 1:
                reach += obstacle_travel(wall, later, apart + model.body.bound[a])
        bound = model.body.bound[a] + reach + travel
        near = apart < bound + model.obstacles.bound[o]
        if near:
            # the body's bounding sphere against the true shape, before its elements one by one
            centre = wp.quat_rotate_inv(wall.rotation, way)
            near = distance_of(distance_to(model.obstacles, o, centre, bound)) < bound
        return wp.where(near, reach, -1.0)

    return wall_reach


def wall_contacts_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, o, pose, move, wall, later, reach, free, drift, listed, count, step) -> count`.

    Body a and obstacle o; the threads of a team take other elements each.
    """
    team = team_of(f)
    lane_of, size_of = team.lane, team.size
    element_wall = element_wall_term(f)

    @wp.func
    def wall_contacts(
        model: ModelData, readout: ReadoutData, world: int, a: int, o: int, pose: Pose, move: Move, wall: Pose,
        later: Pose, reach: float, free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6), listed: ContactList,
        count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """Count of contacts [1] when each element of body a has been held against obstacle o."""
        if wp.static(f.periodic):
            pose.position += image_shift(model.period, pose.position - wall.position)
        last = model.contact.start[a + 1] - 1
        for first in range(model.contact.start[a], last + 1, size_of()):
            i = wp.min(first + lane_of(), last)
            count = element_wall(
                model, readout, world, a, o, i, pose, move, wall, later, first + lane_of() <= last, reach, free, drift,
                listed, count, step,
            )  # fmt: skip
        return count

    return wall_contacts
