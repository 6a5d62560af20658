"""Finding contacts: between the elements of two bodies, and between the elements of a body and the obstacles.

Elements are spheres and rods. A contact is listed within reach: the range of the adhesion, how much of the gap the free
moves of this step close, and how far other contacts may push on top of that; so that nothing passes through another or
through a thin wall between two looks. Normals are those at the start of the step: a body that moves by more than its
radius in one step can be stopped by what lies beside its path.
"""

import warp as wp

from otwarp.kernels.contact.contact import (
    NO_CONTACT,
    Contact,
    along,
    hardest,
    pair_law,
    pair_reach,
)
from otwarp.kernels.contact.contact_list import ContactList, put_term
from otwarp.kernels.contact.curvature import beside_rod, path_bend_term, relative_radius_term
from otwarp.kernels.contact.excursion import excursion_term, obstacle_name
from otwarp.kernels.contact.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.contact.response import give_term, response_term
from otwarp.kernels.contact.segments import (
    MERGE,
    Segment,
    nearest_t,
    obstacle_slope_term,
    pieces_of,
    place_on,
    segment_slope,
    valley_counts,
    valley_t,
    valley_term,
)
from otwarp.kernels.contact.travel import closing_of, free_travel, obstacle_drift, obstacle_travel, opening_of
from otwarp.kernels.core.faults import OVERLAP_LIMIT, Fault, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity
from otwarp.kernels.core.packed import curvature_of, distance_of, point_of, radius_of
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.types import ModelData, Move, Pose, ReadoutData


def new_contact_term(f: Features) -> wp.Function:
    """Fill in what the solver needs of a contact: forces, and how far each body gives way."""
    response, give_of = response_term(f), give_term(f)

    @wp.func
    def new_contact(
        model: ModelData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose, arm_a: wp.vec3, arm_b: wp.vec3,
        normal: wp.vec3, radius: float, overlap: float,
    ) -> Contact:  # fmt: skip
        """Force law [pN, pN/µm] at the present overlap, and moves per unit contact force [µm/pN] of both bodies."""
        scale = step_over_viscosity(model, world)
        law = pair_law(model.contact, a, b, radius, overlap)
        c = Contact()
        c.a = a
        c.b = b
        c.normal = normal
        c.arm_a = arm_a
        c.arm_b = arm_b
        c.radius = radius
        c.overlap = overlap
        c.hardness = law.hardness
        c.force = law.force
        # the adhesion across a gap stays what it is until the gap is closed
        c.floor = wp.where(overlap > 0.0, law.floor, law.force)
        c.stiffness = law.stiffness
        if wp.static(f.body_space):
            c.give = give_of(model, a, pose_a, scale, arm_a, normal)
            if b >= 0:
                c.give += give_of(model, b, pose_b, scale, arm_b, normal)
            c.hardness = wp.min(c.hardness, hardest(radius, c.give))
        else:
            c.response_a = response(model, a, pose_a, scale, arm_a, normal)
            c.give = along(c.response_a, arm_a, normal)
            if b >= 0:
                c.response_b = response(model, b, pose_b, scale, arm_b, -normal)
                c.give -= along(c.response_b, arm_b, normal)
        return c

    return new_contact


def touch_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, b, pose_a, pose_b, arm_a, arm_b, ri, rj, step) -> Contact` of two elements.

    The arms lead to the centres of spheres and to the nearest points of the axes of rods. Spheres on the same centre
    touch too: they have no normal, but a fault.
    """
    new_contact = new_contact_term(f)

    @wp.func
    def touch(
        model: ModelData, readout: ReadoutData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose,
        arm_a: wp.vec3, arm_b: wp.vec3, ri: float, rj: float, step: wp.int64,
    ) -> Contact:  # fmt: skip
        """Normal, overlap and effective radius [µm] of two spheres of radii ri, rj; a fault if they overlap too far."""
        way = pose_a.position - pose_b.position + arm_a - arm_b
        overlap = ri + rj - wp.length(way)
        if overlap > OVERLAP_LIMIT * wp.min(ri, rj):
            raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
        radius = ri * rj / (ri + rj)
        c = new_contact(model, world, a, b, pose_a, pose_b, arm_a, arm_b, wp.normalize(way), radius, overlap)
        c.curvature = 1.0 / (ri + rj)
        return c

    return touch


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


def element_term(f: Features) -> wp.Function:
    """`(contact, i, pose) -> Segment`: element i of a body relative to its reference point, world axes."""

    @wp.func
    def element(model: ModelData, i: int, rotation: wp.quat) -> Segment:
        """Centre of a sphere, or middle and half of a rod [µm], from the body's reference point in world axes."""
        s = model.contact.sphere[i]
        rod = Segment(wp.quat_rotate(rotation, point_of(s)), wp.vec3(0.0))
        if wp.static(f.rods):
            rod.half = wp.quat_rotate(rotation, model.contact.half[i])
        return rod

    return element


def element_pair_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, b, pose_a, pose_b, move_a, move_b, i, j, rod_a, rod_b, ri, rj, reach, …)`.

    Elements i and j of bodies a and b; the new count. `reach` [µm]: gap within which a contact is listed whether or not
    the moves close it.
    """
    touch = touch_term(f)
    put = put_term(f)
    excursion = excursion_term(f)
    valley = valley_term(segment_slope) if f.rods else None

    @wp.func
    def element_pair(
        model: ModelData, readout: ReadoutData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose,
        move_a: Move, move_b: Move, i: int, j: int, rod_a: Segment, rod_b: Segment, ri: float, rj: float, reach: float,
        listed: ContactList, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """Two spheres at once; a rod at the point nearest to a sphere; two rods at their valley of nearest points."""
        between = pose_a.position - pose_b.position
        if wp.static(not f.rods):
            way = between + rod_a.centre - rod_b.centre
            if wp.length(way) < ri + rj + reach + closing_of(move_a, move_b, rod_a.centre, rod_b.centre, way):
                c = touch(
                    model, readout, world, a, b, pose_a, pose_b, rod_a.centre, rod_b.centre, ri, rj, step
                )  # fmt: skip
                c = excursion(model, world, c, opening_of(c, move_a, move_b), i, j, 0, step)
                count = put(readout, world, listed, count, c, step)
        else:
            # all relative to the reference point of a, so that a place far from the origin costs no digits
            other = Segment(rod_b.centre - between, rod_b.half)
            apart = wp.length(rod_a.centre - other.centre) - wp.length(rod_a.half) - wp.length(other.half)
            ahead = free_travel(model, a, move_a) + free_travel(model, b, move_b)
            if apart < ri + rj + reach + ahead:
                single = wp.length_sq(rod_a.half) == 0.0 or wp.length_sq(rod_b.half) == 0.0
                v = valley(model.obstacles, 0, other, rod_a, 0, 1, 0.0)
                merge = MERGE * ri / wp.max(wp.length(rod_a.half), 1.0e-30)
                for choice in range(3):
                    t = valley_t(v, choice)
                    wanted = valley_counts(v, choice, merge)
                    if single:
                        t = nearest_t(rod_a, other.centre)
                        wanted = choice == 1
                    if wanted:
                        point = place_on(rod_a, t)
                        near = place_on(other, nearest_t(other, point))
                        closing = closing_of(move_a, move_b, point, near + between, point - near)
                        if wp.length(point - near) < ri + rj + reach + closing:
                            c = touch(
                                model, readout, world, a, b, pose_a, pose_b, point, near + between, ri, rj, step
                            )  # fmt: skip
                            c = beside_rod(beside_rod(c, rod_a.half), rod_b.half)
                            c = excursion(model, world, c, opening_of(c, move_a, move_b), i, j, choice, step)
                            count = put(readout, world, listed, count, c, step)
        return count

    return element_pair


def pair_contacts_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, b, pose_a, pose_b, move_a, move_b, pushed, listed, count, step) -> count`.

    The moves are the free ones of this step; `pushed` [µm]: how much nearer other contacts may push the bodies.
    """
    element = element_term(f)
    element_pair = element_pair_term(f)

    @wp.func
    def pair_contacts(
        model: ModelData, readout: ReadoutData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose, move_a: Move,
        move_b: Move, pushed: float, listed: ContactList, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """New count; tests bounding spheres, then element against body, then element against element."""
        reach = pair_reach(model.contact, a, b) + pushed
        far = reach + free_travel(model, a, move_a) + free_travel(model, b, move_b)
        between = pose_a.position - pose_b.position
        if wp.length(between) < model.body.bound[a] + model.body.bound[b] + far:
            for i in range(model.contact.start[a], model.contact.start[a + 1]):
                rod_a = element(model, i, pose_a.rotation)
                ri = radius_of(model.contact.sphere[i])
                # one element against the bounding sphere of b, before its elements one by one
                size = ri
                if wp.static(f.rods):
                    size += wp.length(rod_a.half)
                if wp.length(between + rod_a.centre) < size + model.body.bound[b] + far:
                    for j in range(model.contact.start[b], model.contact.start[b + 1]):
                        rod_b = element(model, j, pose_b.rotation)
                        rj = radius_of(model.contact.sphere[j])
                        count = element_pair(
                            model, readout, world, a, b, pose_a, pose_b, move_a, move_b, i, j, rod_a, rod_b, ri, rj,
                            reach, listed, count, step,
                        )  # fmt: skip
        return count

    return pair_contacts


def element_wall_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, o, i, pose, move, wall, later, reach, listed, count, step) -> count`.

    Element i of body a against obstacle o; `reach` [µm]: gap up to which its own move need not close it.
    """
    touch_wall = touch_wall_term(f)
    put = put_term(f)
    excursion = excursion_term(f)
    element = element_term(f)
    distance_to = distance_term(f.obstacles)
    valley = valley_term(obstacle_slope_term(distance_to)) if f.rods else None

    @wp.func
    def element_wall(
        model: ModelData, readout: ReadoutData, world: int, a: int, o: int, i: int,
        pose: Pose, move: Move, wall: Pose, later: Pose, reach: float,
        listed: ContactList, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """A sphere at its centre; a rod at the valley of its distance to the obstacle, piece by piece."""
        rod = element(model, i, pose.rotation)
        radius = radius_of(model.contact.sphere[i])
        local = wp.quat_rotate_inv(wall.rotation, pose.position + rod.centre - wall.position)
        half = float(0.0)
        if wp.static(f.rods):
            half = wp.length(rod.half)
        far = radius + half + reach + free_travel(model, a, move)
        still = Move(wp.vec3(0.0), wp.vec3(0.0))
        hit = distance_to(model.obstacles, o, local, far)
        if distance_of(hit) < far:
            if half == 0.0:
                way = wp.quat_rotate(wall.rotation, point_of(hit))
                if distance_of(hit) < radius + reach + closing_of(move, still, rod.centre, rod.centre, way):
                    c = touch_wall(model, readout, world, a, o, pose, wall, later, rod.centre, radius, local, hit, step)
                    c = excursion(model, world, c, opening_of(c, move, still), i, obstacle_name(o), 0, step)
                    count = put(readout, world, listed, count, c, step)
            elif wp.static(f.rods):
                inside = Segment(local, wp.quat_rotate_inv(wall.rotation, rod.half))
                far += half  # so that a mesh answers everywhere along the rod
                merge = MERGE * radius / half
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
                            if distance_of(hit) < radius + reach + closing_of(move, still, arm, arm, way):
                                c = touch_wall(
                                    model, readout, world, a, o, pose, wall, later, arm, radius, point, hit, step
                                )  # fmt: skip
                                c = beside_rod(c, rod.half)
                                c = excursion(
                                    model, world, c, opening_of(c, move, still), i, obstacle_name(o), choice, step
                                )  # fmt: skip
                                count = put(readout, world, listed, count, c, step)
        return count

    return element_wall


def wall_poses_term(f: Features) -> wp.Function:
    """`(model, o, time) -> (wall, later)`: pose of obstacle o now and at the end of the step from `time`."""
    pose_at = moving_pose if f.moving_obstacles else still_pose

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


def wall_contacts_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, o, pose, move, wall, later, pushed, listed, count, step) -> count`.

    Body a and obstacle o. `move` is the free one of this step; `pushed` [µm]: how far other contacts may push the body
    on top of it.
    """
    element_wall = element_wall_term(f)
    distance_to = distance_term(f.obstacles)

    @wp.func
    def wall_contacts(
        model: ModelData, readout: ReadoutData, world: int, a: int, o: int, pose: Pose, move: Move, wall: Pose,
        later: Pose, pushed: float, listed: ContactList, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """New count; tests the bounding sphere, then the true shape, then element by element."""
        travel = free_travel(model, a, move)
        if wp.static(f.periodic):
            pose.position += image_shift(model.period, pose.position - wall.position)
        reach = pair_reach(model.contact, a, NO_CONTACT) + pushed
        centre = wp.quat_rotate_inv(wall.rotation, pose.position - wall.position)
        if wp.static(f.moving_obstacles):
            if model.obstacles.key_start[o + 1] - model.obstacles.key_start[o] > 1:
                reach += obstacle_travel(wall, later, wp.length(centre) + model.body.bound[a])
        bound = model.body.bound[a] + reach + travel
        near = wp.length(centre) < bound + model.obstacles.bound[o]
        if near:
            # the body's bounding sphere against the true shape, before its elements one by one
            near = distance_of(distance_to(model.obstacles, o, centre, bound)) < bound
        if near:
            for i in range(model.contact.start[a], model.contact.start[a + 1]):
                count = element_wall(
                    model, readout, world, a, o, i, pose, move, wall, later, reach, listed, count, step
                )  # fmt: skip
        return count

    return wall_contacts
