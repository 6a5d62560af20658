"""Finding contacts: between the elements of two bodies, and between the elements of a body and the obstacles.

Elements are spheres and rods. A contact is listed within reach: the range of the adhesion, how much of the gap the free
moves of this step close, and how far other contacts may push on top of that; so that nothing passes through another or
through a thin wall between two looks. Normals are those at the start of the step: a body that moves by more than its
radius in one step can be stopped by what lies beside its path.
"""

import warp as wp

from otwarp.kernels.contact.contact import (
    Contact,
    along,
    hardest,
    pair_law,
    pair_reach,
)
from otwarp.kernels.contact.contact_list import ContactList, counted_term, put_term
from otwarp.kernels.contact.curvature import beside_rod
from otwarp.kernels.contact.excursion import excursion_term
from otwarp.kernels.contact.open_gaps import first_opening_term
from otwarp.kernels.contact.response import give_term, response_term
from otwarp.kernels.contact.segments import (
    MERGE,
    Segment,
    nearest_t,
    place_on,
    segment_slope,
    valley_counts,
    valley_t,
    valley_term,
)
from otwarp.kernels.contact.travel import closing_of, free_travel, opening_of
from otwarp.kernels.core.faults import OVERLAP_LIMIT, Fault, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity
from otwarp.kernels.core.packed import point_of, radius_of
from otwarp.kernels.core.reads import vec4_at
from otwarp.kernels.core.roots import direction_of, length_of
from otwarp.kernels.core.team import count_below, team_of
from otwarp.kernels.core.types import ModelData, Move, Pose, ReadoutData, vec6


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
        overlap = ri + rj - length_of(way)
        if overlap > OVERLAP_LIMIT * wp.min(ri, rj):
            raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
        radius = ri * rj / (ri + rj)
        c = new_contact(model, world, a, b, pose_a, pose_b, arm_a, arm_b, direction_of(way), radius, overlap)
        c.curvature = 1.0 / (ri + rj)
        return c

    return touch


def element_term(f: Features) -> wp.Function:
    """`(contact, i, pose) -> Segment`: element i of a body relative to its reference point, world axes."""

    @wp.func
    def element(model: ModelData, i: int, rotation: wp.quat) -> Segment:
        """Centre of a sphere, or middle and half of a rod [µm], from the body's reference point in world axes."""
        s = vec4_at(model.contact.sphere, i)
        rod = Segment(wp.quat_rotate(rotation, point_of(s)), wp.vec3(0.0))
        if wp.static(f.rods):
            rod.half = wp.quat_rotate(rotation, model.contact.half[i])
        return rod

    return element


def element_pair_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, b, pose_a, pose_b, move_a, move_b, i, j, rod_a, rod_b, wanted, reach, …)`.

    Elements i and j of bodies a and b, others in each thread of the team, if they are `wanted`; the new count. `reach`
    [µm]: gap within which a contact is listed whether or not the moves close it.
    """
    return rod_pair_term(f) if f.rods else sphere_pair_term(f)


def sphere_pair_term(f: Features) -> wp.Function:
    """`element_pair_term` where all elements are spheres."""
    team = team_of(f)
    votes_of, lane_of = team.votes, team.lane
    touch, excursion = touch_term(f), excursion_term(f)
    put, counted, first_opening = put_term(f), counted_term(f), first_opening_term(f)

    @wp.func
    def sphere_pair(
        model: ModelData, readout: ReadoutData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose,
        move_a: Move, move_b: Move, i: int, j: int, rod_a: Segment, rod_b: Segment, wanted: bool, reach: float,
        free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6), listed: ContactList, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """Two spheres at once: each thread of the team finds out whether its own touch."""
        ri = radius_of(vec4_at(model.contact.sphere, i))
        rj = radius_of(vec4_at(model.contact.sphere, j))
        near = bool(wanted)
        if near:
            way = pose_a.position - pose_b.position + rod_a.centre - rod_b.centre
            closing = closing_of(move_a, move_b, rod_a.centre, rod_b.centre, way)
            near = length_of(way) < ri + rj + reach + closing
        votes = votes_of(near)
        if near:
            c = touch(model, readout, world, a, b, pose_a, pose_b, rod_a.centre, rod_b.centre, ri, rj, step)
            opening = opening_of(c, move_a, move_b)
            c = excursion(model, world, c, opening, i, j, 0, step)
            opening = first_opening(c, opening, free, drift)
            put(readout, world, listed, count + count_below(votes, lane_of()), c, opening, step)
        return counted(votes, count)

    return sphere_pair


def rod_pair_term(f: Features) -> wp.Function:
    """`element_pair_term` where elements may be rods: a team is one thread."""
    touch, excursion, put, first_opening = touch_term(f), excursion_term(f), put_term(f), first_opening_term(f)
    valley = valley_term(segment_slope)

    @wp.func
    def rod_pair(
        model: ModelData, readout: ReadoutData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose,
        move_a: Move, move_b: Move, i: int, j: int, rod_a: Segment, rod_b: Segment, wanted: bool, reach: float,
        free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6), listed: ContactList, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """A rod at the point nearest to a sphere; two rods at their valley of nearest points."""
        ri = radius_of(vec4_at(model.contact.sphere, i))
        rj = radius_of(vec4_at(model.contact.sphere, j))
        between = pose_a.position - pose_b.position
        # all relative to the reference point of a, so that a place far from the origin costs no digits
        other = Segment(rod_b.centre - between, rod_b.half)
        apart = length_of(rod_a.centre - other.centre) - length_of(rod_a.half) - length_of(other.half)
        ahead = free_travel(model, a, move_a) + free_travel(model, b, move_b)
        if wanted and apart < ri + rj + reach + ahead:
            single = wp.length_sq(rod_a.half) == 0.0 or wp.length_sq(rod_b.half) == 0.0
            v = valley(model.obstacles, 0, other, rod_a, 0, 1, 0.0)
            merge = MERGE * ri / wp.max(length_of(rod_a.half), 1.0e-30)
            for choice in range(3):
                t = valley_t(v, choice)
                counts = valley_counts(v, choice, merge)
                if single:
                    t = nearest_t(rod_a, other.centre)
                    counts = choice == 1
                if counts:
                    point = place_on(rod_a, t)
                    facing = place_on(other, nearest_t(other, point))
                    closing = closing_of(move_a, move_b, point, facing + between, point - facing)
                    if length_of(point - facing) < ri + rj + reach + closing:
                        c = touch(model, readout, world, a, b, pose_a, pose_b, point, facing + between, ri, rj, step)
                        c = beside_rod(beside_rod(c, rod_a.half), rod_b.half)
                        opening = opening_of(c, move_a, move_b)
                        c = excursion(model, world, c, opening, i, j, choice, step)
                        opening = first_opening(c, opening, free, drift)
                        count = put(readout, world, listed, count, c, opening, step)
        return count

    return rod_pair


def pair_reach_term(f: Features) -> wp.Function:
    """`(model, a, b, pose_a, pose_b, travel, pushed) -> reach`, as `pair_contacts_term` takes it.

    `travel` [µm]: how far the free moves of this step take any points of both bodies together.
    """

    @wp.func
    def reach_of_pair(
        model: ModelData, a: int, b: int, pose_a: Pose, pose_b: Pose, travel: float, pushed: float
    ) -> float:  # fmt: skip
        """Gap [µm] within which contacts are listed whether or not the moves close it; −1 for bodies too far apart."""
        reach = pair_reach(model.contact, a, b) + pushed
        apart = length_of(pose_a.position - pose_b.position)
        return wp.where(apart < model.body.bound[a] + model.body.bound[b] + reach + travel, reach, -1.0)

    return reach_of_pair


def pair_contacts_term(f: Features) -> wp.Function:
    """`(model, readout, world, a, b, pose_a, pose_b, move_a, move_b, reach, free, drift, …, step) -> count`.

    The moves are the free ones of this step, `free` those of all bodies and `drift` what of them is not noise. The
    threads of a team take other elements each, of the body that has more than one.
    """
    team = team_of(f)
    votes_of, lane_of, size_of = team.votes, team.lane, team.size
    element = element_term(f)
    element_pair = element_pair_term(f)

    @wp.func
    def pair_contacts(
        model: ModelData, readout: ReadoutData, world: int, a: int, b: int, pose_a: Pose, pose_b: Pose, move_a: Move,
        move_b: Move, reach: float, free: wp.array(dtype=vec6), drift: wp.array(dtype=vec6), listed: ContactList,
        count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """New count; tests element against body, then element against element."""
        far = reach + free_travel(model, a, move_a) + free_travel(model, b, move_b)
        between = pose_a.position - pose_b.position
        last_a = model.contact.start[a + 1] - 1
        last_b = model.contact.start[b + 1] - 1
        several = last_b > model.contact.start[b]
        lane_a = wp.where(several, 0, lane_of())
        lane_b = wp.where(several, lane_of(), 0)
        for first_a in range(model.contact.start[a], last_a + 1, wp.where(several, 1, size_of())):
            i = wp.min(first_a + lane_a, last_a)
            rod_a = element(model, i, pose_a.rotation)
            # one element against the bounding sphere of b, before its elements one by one
            size = radius_of(vec4_at(model.contact.sphere, i))
            if wp.static(f.rods):
                size += length_of(rod_a.half)
            near = first_a + lane_a <= last_a and length_of(between + rod_a.centre) < size + model.body.bound[b] + far
            if votes_of(near) != 0:
                for first_b in range(model.contact.start[b], last_b + 1, wp.where(several, size_of(), 1)):
                    j = wp.min(first_b + lane_b, last_b)
                    rod_b = element(model, j, pose_b.rotation)
                    count = element_pair(
                        model, readout, world, a, b, pose_a, pose_b, move_a, move_b, i, j, rod_a, rod_b,
                        near and first_b + lane_b <= last_b, reach, free, drift, listed, count, step,
                    )  # fmt: skip
        return count

    return pair_contacts
