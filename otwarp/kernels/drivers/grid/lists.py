"""Contacts of the grid driver: every body lists its own, in the order of its neighbour lists."""

import warp as wp

from otwarp.kernels.contact.contact import Contact, along
from otwarp.kernels.contact.detect import touch_term
from otwarp.kernels.contact.travel import thermal_reach, wander_of
from otwarp.kernels.core.faults import Fault, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import distance_of, point_of, radius_of
from otwarp.kernels.core.periodic import image_shift, nearest
from otwarp.kernels.core.types import ModelData, Move, Pose, ReadoutData, StateData
from otwarp.kernels.drivers.grid.data import GridData, PushData, body_pose_term, own_term
from otwarp.kernels.drivers.grid.neighbours import FULL, next_in_cells_term, obstacle_bit
from otwarp.kernels.drivers.grid.reach import (
    PUSHED,
    drawn_term,
    travel_term,
    wall_contact_term,
    wall_hit_term,
    wall_reach_term,
)
from otwarp.kernels.drivers.grid.store import contact_store_terms


def list_contact_term(f: Features) -> wp.Function:
    """`(readout, grid, world, row, count, c, step) -> count`: append a contact to the list of a body."""
    write_contact = contact_store_terms(f)[0]

    @wp.func
    def list_contact(
        readout: ReadoutData, grid: GridData, world: int, row: int, count: int, c: Contact, step: wp.int64
    ) -> int:
        """The new count; a fault if the list is full."""
        if count == grid.ahead.shape[1]:
            raise_fault(readout, world, c.a, wp.static(int(Fault.OVERFLOW)), step)
            return count
        write_contact(grid, row, count, c)
        return count + 1

    return list_contact


def arm_term(f: Features) -> wp.Function:
    """`(pose, sphere) -> arm` from a body's reference point to the centre of its sphere; a lone sphere has none."""

    @wp.func
    def arm_of(pose: Pose, sphere: wp.vec4) -> wp.vec3:
        """Arm [µm] in world axes; 0 for a lone sphere."""
        arm = wp.vec3(0.0)
        if wp.static(f.rigid):
            arm = wp.quat_rotate(pose.rotation, point_of(sphere))
        return arm

    return arm_of


def near_enough_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, a, e, j, centre) -> bool`: whether two spheres are to be looked at as a contact."""
    arm_of, body_pose, travel = arm_term(f), body_pose_term(f), travel_term(f)

    @wp.func
    def near_enough(
        model: ModelData, state: StateData, grid: GridData, world: int, a: int, e: int, j: int, centre: wp.vec3
    ) -> bool:
        """Whether sphere e of body a, at `centre`, and sphere j feel each other, or may in this step."""
        si, sj = model.contact.sphere[e], model.contact.sphere[j]
        b = model.contact.body[j]
        pose = body_pose(state, world, b)
        far = radius_of(si) + radius_of(sj) + grid.near.reach
        away = centre - pose.position - arm_of(pose, sj)
        if wp.static(f.periodic):
            away = nearest(model.period, away)
        square = wp.length_sq(away)
        near = square < far * far
        if near:
            # what moves are large enough for, before anything is made of it
            beyond = PUSHED * wp.min(radius_of(si), radius_of(sj))
            if wp.static(f.brownian):
                beyond = wp.max(beyond, thermal_reach(wander_of(model, world, a) + wander_of(model, world, b)))
            ahead = travel(model, grid, world, a) + travel(model, grid, world, b) + beyond
            far = radius_of(si) + radius_of(sj) + wp.min(grid.near.adhesion + ahead, grid.near.reach)
            near = square < far * far
        return near

    return near_enough


def sphere_contact_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, a, e, j, pose, step) -> Contact` of sphere e of body a with sphere j."""
    touch = touch_term(f)
    arm_of, body_pose, drawn = arm_term(f), body_pose_term(f), drawn_term(f)

    @wp.func
    def sphere_contact(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, a: int, e: int, j: int,
        pose: Pose, step: wp.int64,
    ) -> Contact:  # fmt: skip
        """The contact of sphere e with sphere j at their present poses."""
        si = model.contact.sphere[e]
        sj = model.contact.sphere[j]
        b = model.contact.body[j]
        pose_b = body_pose(state, world, b)
        if wp.static(f.periodic):
            # of the later body in both views, so that both have the same numbers
            shift = image_shift(model.period, pose_b.position - pose.position)
            if a < b:
                pose_b.position += shift
            else:
                pose.position -= shift
        arm_a, arm_b = arm_of(pose, si), arm_of(pose_b, sj)
        c = touch(model, readout, world, a, b, pose, pose_b, arm_a, arm_b, radius_of(si), radius_of(sj), step)
        return drawn(model, grid, world, c, e, j, step)

    return sphere_contact


def sphere_contacts_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, a, e, pose, count, step) -> count` of sphere e of body a with others."""
    arm_of, near_enough, sphere_contact = arm_term(f), near_enough_term(f), sphere_contact_term(f)
    list_contact = list_contact_term(f)
    next_in_cells = next_in_cells_term(f)

    @wp.func
    def lists(model: ModelData, a: int, j: int) -> bool:
        """Whether body a lists its contact with sphere j: every body does, or where they take turns the first."""
        its = bool(True)
        if wp.static(f.in_turn):
            its = a < model.contact.body[j]
        return its

    @wp.func
    def sphere_contacts(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, a: int, e: int,
        pose: Pose, count: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """The neighbours of its list, which ascend: the sum of forces depends on their order in the last bit."""
        n = grid.near
        first = world * n.elements
        i = first + e
        listed = n.count[i]
        centre = pose.position
        if listed != 0:
            centre += arm_of(pose, model.contact.sphere[e])
        last = int(-1)
        k = int(0)
        while k < listed or listed == FULL:
            if listed == FULL:
                last = next_in_cells(model, state, grid, world, i, last)
            else:
                last = n.neighbour[i * n.stride + k * n.pitch]
            if last < 0:
                break
            j = last - first
            # the distance first: a contact is a large thing to make
            if lists(model, a, j) and (listed == FULL or near_enough(model, state, grid, world, a, e, j, centre)):
                c = sphere_contact(model, state, readout, grid, world, a, e, j, pose, step)
                count = list_contact(readout, grid, world, world * model.bodies + a, count, c, step)
            k += 1
        return count

    return sphere_contacts


def wall_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, e, pose, count, step) -> count` of sphere e of body a with obstacles."""
    wall_reach, wall_hit, wall_contact = wall_reach_term(f), wall_hit_term(f), wall_contact_term(f)
    arm_of, list_contact = arm_term(f), list_contact_term(f)

    @wp.func
    def walls(
        model: ModelData, readout: ReadoutData, grid: GridData, world: int, a: int, e: int, pose: Pose, count: int,
        step: wp.int64,
    ) -> int:  # fmt: skip
        """Append the contacts of sphere e with all obstacles within its reach in this step: the new count."""
        near = grid.near.walled[world * grid.near.elements + e]
        s = model.contact.sphere[e]
        arm = arm_of(pose, s)
        far = wall_reach(model, grid, world, a, radius_of(s))
        for o in range(model.obstacles.shape.shape[0]):
            if near & obstacle_bit(o) != 0:
                at = wall_hit(model, o, pose, arm, far, step)
                if distance_of(at.hit) < far:
                    c = wall_contact(model, readout, grid, world, a, e, o, arm, at, step)
                    count = list_contact(readout, grid, world, world * model.bodies + a, count, c, step)
        return count

    return walls


def row_sum_term(f: Features) -> wp.Function:
    """`(grid, row, count, a) -> row_sum`: how much more a body gives way to all its contacts at once than to one.

    The largest Σ_j |response of contact i's gap to force j| / |its response to its own|, a bound by Gershgorin's
    theorem; of this body's share alone.
    """
    read_contact = contact_store_terms(f)[1]

    @wp.func
    def row_sum_of(grid: GridData, row: int, count: int, a: int) -> float:
        """Largest row sum of |responses| over the own one, ≥ 1; 1 for a lone contact."""
        row_sum = float(1.0)
        for i in range(count):
            c = read_contact(grid, row, i, a)
            own = along(c.response_a, c.arm_a, c.normal)
            total = float(0.0)
            for j in range(count):
                total += wp.abs(along(read_contact(grid, row, j, a).response_a, c.arm_a, c.normal))
            if own > 0.0:
                row_sum = wp.max(row_sum, total / own)
        return row_sum

    return row_sum_of


def first_push_term(f: Features) -> wp.Function:
    """`(grid, row, count, a) -> Move`: what a body's contact forces at the start would move."""
    read_contact = contact_store_terms(f)[1]

    @wp.func
    def first_push(grid: GridData, row: int, count: int, a: int) -> Move:
        """Move [µm, rad] by the loads of the contacts; writes these loads to `ahead`, too."""
        total = Move(wp.vec3(0.0), wp.vec3(0.0))
        for i in range(count):
            c = read_contact(grid, row, i, a)
            grid.ahead[row, i] = c.load
            total.linear += c.load * c.response_a.linear
            total.angular += c.load * c.response_a.angular
        return total

    return first_push


def find_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, push, world, a)`: a body's contacts and what their forces would move."""
    sphere_contacts = sphere_contacts_term(f) if f.pairs else None
    walls = wall_term(f) if f.obstacles else None
    body_pose, own = body_pose_term(f), own_term(f)
    row_sum_of = row_sum_term(f)
    first_push = first_push_term(f)

    @wp.func
    def find_body(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, world: int, a: int
    ):
        """List the contacts of body a, and write its first push [µm, rad]."""
        step = grid.clock[own(world)]
        row = world * model.bodies + a
        pose = body_pose(state, world, a)
        count = int(0)
        for e in range(model.contact.start[a], model.contact.start[a + 1]):
            if wp.static(f.pairs):
                count = sphere_contacts(model, state, readout, grid, world, a, e, pose, count, step)
            if wp.static(bool(f.obstacles)):
                if grid.near.walled[world * grid.near.elements + e] != 0:
                    count = walls(model, readout, grid, world, a, e, pose, count, step)
        grid.count[world, a] = count
        if wp.static(f.in_turn):
            push.linear[world, a] = wp.vec3(0.0)
            if wp.static(f.rigid):
                push.angular[world, a] = wp.vec3(0.0)
        elif count > 0:
            grid.row_sum[world, a] = row_sum_of(grid, row, count, a)
            move = first_push(grid, row, count, a)
            push.linear[world, a] = move.linear
            if wp.static(f.rigid):
                push.angular[world, a] = move.angular
        if step + wp.int64(1) == grid.until[own(world)]:
            # of a body that touches nothing; sweeps write what the others feel
            readout.contact_force[world, a] = wp.vec3(0.0)
            readout.contact_load[world, a] = 0.0

    return find_body


def make_find(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its bodies): their contacts, and what the forces at the start would move."""
    find_body = find_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def find(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, size: int):
        """Contacts and first pushes of the `size` bodies of one share of a world."""
        world, share = wp.tid()
        for a in range(share * size, wp.min((share + 1) * size, model.bodies)):
            find_body(model, state, readout, grid, push, world, a)

    return find
