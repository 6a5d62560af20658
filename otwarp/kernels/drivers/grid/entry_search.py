"""Which contacts of a world are solved in a step, and what is known of each.

Solved are those that the free moves of the step may close: what is in touch or comes to be, feels adhesion, or may be
met by a Brownian path in between. Nothing but other contacts could push most neighbours together: when the forces are
known, gaps that these have closed become entries too, and all are solved on. So the forces are those of all neighbours,
while few of them are entries in a crowd that jostles.
"""

import warp as wp

from otwarp.kernels.contact.contact import SETTLED, Contact
from otwarp.kernels.contact.excursion import FARTHEST, kept_reach, obstacle_name
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import distance_of, radius_of
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.types import ModelData, ReadoutData, StateData
from otwarp.kernels.drivers.grid.data import GridData, PushData, body_pose_term
from otwarp.kernels.drivers.grid.entries import (
    claim,
    entry_of,
    read_link,
    read_pair,
    read_vector,
    write_entry_term,
    write_number,
)
from otwarp.kernels.drivers.grid.lists import arm_term, sphere_contact_term
from otwarp.kernels.drivers.grid.neighbours import FULL, next_in_cells_term, obstacle_bit
from otwarp.kernels.drivers.grid.reach import free_opening_term, wall_contact_term, wall_hit_term, wall_reach_term

UNLIKELY = wp.constant(0.25)
"""Weight in the row sums of others of an entry that free moves do not press, over that of one that they do."""


@wp.struct
class Course:
    """Where an element is at the start of a step, and how it moves in it."""

    centre: wp.vec3
    """[µm]"""
    move: wp.vec3
    """[µm]"""
    bow: float
    """How much nearer to another its turning may bring it beyond that [µm]."""
    radius: float
    """[µm]"""


def course_term(f: Features) -> wp.Function:
    """`(model, state, grid, push, world, e, pushed) -> Course` of element e by its free move, and pushes."""
    arm_of, body_pose = arm_term(f), body_pose_term(f)

    @wp.func
    def course(
        model: ModelData, state: StateData, grid: GridData, push: PushData, world: int, e: int, pushed: bool
    ) -> Course:
        """Place and move [µm] of element e."""
        a = model.contact.body[e]
        sphere = model.contact.sphere[e]
        pose = body_pose(state, world, a)
        c = Course(pose.position, read_vector(grid.linear, world, a), 0.0, radius_of(sphere))
        pushed = pushed and read_link(grid.entry.links, world, a) > 0
        if pushed:
            c.move += read_vector(push.linear, world, a)
        if wp.static(f.rigid):
            arm = arm_of(pose, sphere)
            turn = read_vector(grid.angular, world, a)
            if pushed:
                turn += read_vector(push.angular, world, a)
            c.centre += arm
            c.move += wp.cross(turn, arm)
            c.bow = 0.5 * wp.length_sq(turn) * wp.length(arm)
        return c

    return course


def gaps_term(f: Features) -> wp.Function:
    """`(model, one, other) -> vec2`: gap of two elements now, and at the end of the step at least [µm]."""

    @wp.func
    def gaps(model: ModelData, one: Course, other: Course) -> wp.vec2:
        """Along the line of centres at the start."""
        way = one.centre - other.centre
        if wp.static(f.periodic):
            way = nearest(model.period, way)
        apart = wp.length(way)
        now = apart - one.radius - other.radius
        opening = wp.dot(one.move - other.move, way) / wp.max(apart, 1.0e-30)
        return wp.vec2(now, now + opening - one.bow - other.bow)

    return gaps


def next_neighbour_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, i, k, last) -> j`: neighbour k of element i, after `last`; -1 after the last one."""
    next_in_cells = next_in_cells_term(f)

    @wp.func
    def next_neighbour(
        model: ModelData, state: StateData, grid: GridData, world: int, i: int, k: int, last: int
    ) -> int:
        """From the list, or from all where that is full."""
        n = grid.near
        listed = n.count[i]
        found = int(-1)
        if listed == FULL:
            found = next_in_cells(model, state, grid, world, i, last)
        elif k < listed:
            found = n.neighbour[i * n.stride + k * n.pitch]
        return found

    return next_neighbour


def look_around_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, push, world, e)`: claim entries for what element e may meet by free moves."""
    course, gaps = course_term(f), gaps_term(f)
    next_neighbour = next_neighbour_term(f) if f.pairs else None
    arm_of, body_pose = arm_term(f), body_pose_term(f)
    wall_reach = wall_reach_term(f) if f.obstacles else None
    wall_hit = wall_hit_term(f) if f.obstacles else None

    @wp.func
    def may_meet(grid: GridData, gap: wp.vec2) -> bool:
        """Whether two elements with these gaps now and in the end may feel each other in this step, see `excursion`."""
        now = gap[0] - grid.near.adhesion
        end = gap[1] - grid.near.adhesion
        met = now <= 0.0 or end <= 0.0 or now * end < FARTHEST * FARTHEST * grid.near.wander
        return met and gap[0] < grid.near.reach

    @wp.func
    def look_around(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, world: int, e: int
    ):
        """Neighbours that come after e, and obstacles."""
        first = world * grid.near.elements
        if wp.static(f.pairs):
            i = first + e
            if grid.near.count[i] != 0:
                own = course(model, state, grid, push, world, e, False)
                k = int(0)
                j = int(0)
                while j >= 0:
                    j = next_neighbour(model, state, grid, world, i, k, wp.where(k > 0, j, -1))
                    k += 1
                    if j > i:
                        gap = gaps(model, own, course(model, state, grid, push, world, j - first, False))
                        if may_meet(grid, gap):
                            claim(model, readout, grid, world, e, j - first)
        if wp.static(bool(f.obstacles)):
            near = grid.near.walled[first + e]
            if near != 0:
                a = model.contact.body[e]
                sphere = model.contact.sphere[e]
                pose = body_pose(state, world, a)
                far = wall_reach(model, grid, world, a, radius_of(sphere))
                for o in range(model.obstacles.shape.shape[0]):
                    if near & obstacle_bit(o) != 0:
                        at = wall_hit(model, o, pose, arm_of(pose, sphere), far, grid.clock[world])
                        if distance_of(at.hit) < far:
                            claim(model, readout, grid, world, e, obstacle_name(o))

    return look_around


def look_again_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, push, world, e, all) -> int`: claim entries for gaps that pushes have closed.

    Of element e, and 1 if there were any. Unless `all`, it must have been pushed.
    """
    course, gaps, next_neighbour = course_term(f), gaps_term(f), next_neighbour_term(f)

    @wp.func
    def is_entry(model: ModelData, grid: GridData, world: int, e: int, j: int) -> bool:
        """Whether elements e < j have an entry."""
        a = model.contact.body[e]
        found = bool(False)
        for k in range(read_link(grid.entry.links, world, a)):
            pair = read_pair(grid.entry.pair, entry_of(read_link(grid.entry.link, world * model.bodies + a, k)))
            found = found or (pair[0] == e and pair[1] == j)
        return found

    @wp.func
    def look_again(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, world: int, e: int,
        all: bool,
    ) -> int:  # fmt: skip
        """A pair of which both were pushed is looked at by its first element."""
        first = world * grid.near.elements
        i = first + e
        met = int(0)
        if grid.near.count[i] != 0 and (all or read_link(grid.entry.links, world, model.contact.body[e]) > 0):
            own = course(model, state, grid, push, world, e, True)
            k = int(0)
            j = int(0)
            while j >= 0:
                j = next_neighbour(model, state, grid, world, i, k, wp.where(k > 0, j, -1))
                k += 1
                other = j - first
                if j > i or (j >= 0 and not all and read_link(grid.entry.links, world, model.contact.body[other]) == 0):
                    gap = gaps(model, own, course(model, state, grid, push, world, other, True))
                    if gap[1] < -wp.static(SETTLED) and gap[0] < grid.near.reach:
                        low = wp.min(e, other)
                        high = wp.max(e, other)
                        if not is_entry(model, grid, world, low, high):
                            claim(model, readout, grid, world, low, high)
                            met = 1
        return met

    return look_again


def make_entry_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, n)`: make the contact that entry n was claimed for."""
    arm_of, body_pose = arm_term(f), body_pose_term(f)
    sphere_contact = sphere_contact_term(f) if f.pairs else None
    wall_reach = wall_reach_term(f) if f.obstacles else None
    wall_hit = wall_hit_term(f) if f.obstacles else None
    wall_contact = wall_contact_term(f) if f.obstacles else None
    write_entry, free_opening = write_entry_term(f), free_opening_term(f)

    @wp.func
    def keep_entry(grid: GridData, world: int, n: int, c: Contact):
        """Write contact c as entry n, and its weight in the row sums of others."""
        write_entry(grid.entry, n, c)
        pressed = c.force != 0.0 or kept_reach(c, free_opening(grid, world, c) + c.give * c.floor) > 0.0
        write_number(grid.entry.likely, n, wp.where(pressed, 1.0, UNLIKELY))

    @wp.func
    def make_entry(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, n: int):
        """Write entry n, and whether the world's contacts are to be solved."""
        step = grid.clock[world]
        pair = read_pair(grid.entry.pair, n)
        e = pair[0]
        other = pair[1]
        a = model.contact.body[e]
        pose = body_pose(state, world, a)
        if wp.static(f.pairs):
            if other >= 0:
                c = sphere_contact(model, state, readout, grid, world, a, e, other, pose, step)
                keep_entry(grid, world, n, c)
        if wp.static(bool(f.obstacles)):
            if other < 0:
                s = model.contact.sphere[e]
                arm = arm_of(pose, s)
                # the name of an obstacle is its own inverse
                o = obstacle_name(other)
                at = wall_hit(model, o, pose, arm, wall_reach(model, grid, world, a, radius_of(s)), step)
                c = wall_contact(model, readout, grid, world, a, e, o, arm, at, step)
                keep_entry(grid, world, n, c)

    return make_entry
