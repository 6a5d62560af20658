"""The contacts of a world as entries that its threads share out, whichever bodies they are of.

A body in a crowd has none or a dozen, so that a thread for each body waits for the longest list. Here threads look for
near pairs element by element, then each makes, weighs and solves contacts one by one: an entry is a contact as one of
its bodies sees it, so that both partners have their own. Entries of an element follow each other in the order of its
neighbours; elements come in no order, on which nothing depends. An entry's numbers are apart in memory, four at a time,
so that threads read side by side.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.excursion import obstacle_name
from otwarp.kernels.core.faults import Fault, raise_fault
from otwarp.kernels.core.features import MAX_BODY_CONTACTS, Features
from otwarp.kernels.core.packed import beside, distance_of, point_of, radius_of
from otwarp.kernels.core.types import ModelData, Move, ReadoutData, StateData
from otwarp.kernels.drivers.grid.data import EntryData, GridData, body_pose_term, whole_contacts
from otwarp.kernels.drivers.grid.lists import arm_term, near_enough_term, sphere_contact_term
from otwarp.kernels.drivers.grid.neighbours import FULL, next_in_cells_term
from otwarp.kernels.drivers.grid.reach import wall_contact_term, wall_hit_term, wall_reach_term

LAW, GIVE, PATH, DRIFT, RIDGE, ARM, OTHER_ARM, LINEAR, ANGULAR = range(9)
"""Rows of `EntryData.part`, see `write_entry`; the last four for contacts that move a body in more than one way."""


def parts(f: Features) -> int:
    """Rows that an entry has."""
    return 9 if whole_contacts(f) else 5


def write_entry_term(f: Features) -> wp.Function:
    """`(entry, n, c)`: store contact c as entry n."""

    @wp.func
    def write_entry(entry: EntryData, n: int, c: Contact):
        """All that a contact has but the partner's response, whose own entry has it."""
        own = wp.dot(c.response_a.linear, c.normal)
        entry.body[n] = wp.vec2i(c.a, c.b)
        entry.part[LAW, n] = beside(c.normal, c.overlap)
        entry.part[GIVE, n] = wp.vec4(c.give, c.hardness, c.floor, c.stiffness)
        entry.part[PATH, n] = wp.vec4(c.wander, c.layer, c.radius, c.curvature)
        entry.part[DRIFT, n] = beside(c.drift, c.lift)
        entry.part[RIDGE, n] = beside(c.ridge, own)
        if wp.static(whole_contacts(f)):
            entry.part[ARM, n] = beside(c.arm_a, 0.0)
            entry.part[OTHER_ARM, n] = beside(c.arm_b, 0.0)
            entry.part[LINEAR, n] = beside(c.response_a.linear, 0.0)
            entry.part[ANGULAR, n] = beside(c.response_a.angular, 0.0)
        entry.load[n] = c.load
        entry.ahead[n] = c.load

    return write_entry


@wp.func
def give_of(ridge: wp.vec4) -> float:
    """How far a force along the normal moves its own body along it [µm/pN], kept beside the ridge."""
    return ridge[3]


def response_term(f: Features) -> wp.Function:
    """`(entry, n) -> Move`: how a body moves per unit force of its entry n [µm/pN, rad/pN]."""

    @wp.func
    def whole_response(entry: EntryData, n: int) -> Move:
        """Translation [µm/pN] and rotation [rad/pN] of the body per unit force at the contact, along its normal."""
        return Move(point_of(entry.part[LINEAR, n]), point_of(entry.part[ANGULAR, n]))

    @wp.func
    def response_along(entry: EntryData, n: int) -> Move:
        """Translation along the contact's normal [µm/pN]."""
        return Move(give_of(entry.part[RIDGE, n]) * point_of(entry.part[LAW, n]), wp.vec3(0.0))

    return whole_response if whole_contacts(f) else response_along


def read_entry_term(f: Features) -> wp.Function:
    """`(entry, n) -> Contact` as `write_entry` stored it; `force` is the load that it has."""
    response = response_term(f)

    @wp.func
    def read_entry(entry: EntryData, n: int) -> Contact:
        """Entry n; what is not used of it is not read."""
        c = Contact()
        pair, drift = entry.body[n], entry.part[DRIFT, n]
        law, give, path = entry.part[LAW, n], entry.part[GIVE, n], entry.part[PATH, n]
        c.a = pair[0]
        c.b = pair[1]
        c.normal = point_of(law)
        c.overlap = law[3]
        c.give = give[0]
        c.hardness = give[1]
        c.floor = give[2]
        c.stiffness = give[3]
        c.wander = path[0]
        c.layer = path[1]
        c.radius = path[2]
        c.curvature = path[3]
        c.drift = point_of(drift)
        c.lift = drift[3]
        c.ridge = point_of(entry.part[RIDGE, n])
        if wp.static(whole_contacts(f)):
            c.arm_a = point_of(entry.part[ARM, n])
            c.arm_b = point_of(entry.part[OTHER_ARM, n])
        c.response_a = response(entry, n)
        c.load = entry.load[n]
        c.force = c.load
        return c

    return read_entry


def note_partners_term(f: Features) -> wp.Function:
    """`(model, state, grid, world, e, listed, walled, found) -> int`: what element e of a world may touch in a step."""
    arm_of, body_pose = arm_term(f), body_pose_term(f)
    near_enough = near_enough_term(f) if f.pairs else None
    next_in_cells = next_in_cells_term(f) if f.pairs else None
    wall_reach = wall_reach_term(f) if f.obstacles else None
    wall_hit = wall_hit_term(f) if f.obstacles else None

    @wp.func
    def add(found: wp.array(dtype=wp.int32), count: int, name: int) -> int:
        """Note a partner if there is room; how many there are."""
        if count < wp.static(MAX_BODY_CONTACTS):
            found[count] = name
        return count + 1

    @wp.func
    def note_partners(
        model: ModelData, state: StateData, grid: GridData, world: int, e: int, listed: int, walled: int,
        found: wp.array(dtype=wp.int32),
    ) -> int:  # fmt: skip
        """Note the neighbours in the order of the list, then obstacles, as elements and `obstacle_name`s; how many."""
        n = grid.near
        first = world * n.elements
        i = first + e
        a = model.contact.body[e]
        pose = body_pose(state, world, a)
        arm = arm_of(pose, model.contact.sphere[e])
        count = int(0)
        if wp.static(f.pairs):
            last = int(-1)
            k = int(0)
            while k < listed or listed == FULL:
                if listed == FULL:
                    last = next_in_cells(model, state, grid, world, i, last)
                else:
                    last = n.neighbour[i * n.stride + k * n.pitch]
                if last < 0:
                    break
                if listed == FULL or near_enough(model, state, grid, world, a, e, last - first, pose.position + arm):
                    count = add(found, count, last - first)
                k += 1
        if wp.static(bool(f.obstacles)):
            if walled != 0:
                far = wall_reach(model, grid, world, a, radius_of(model.contact.sphere[e]))
                for o in range(model.obstacles.shape.shape[0]):
                    if distance_of(wall_hit(model, o, pose, arm, far, grid.clock[world]).hit) < far:
                        count = add(found, count, obstacle_name(o))
        return count

    return note_partners


def look_around_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, e)`: list what element e of a world may touch in this step."""
    note_partners = note_partners_term(f)

    @wp.func
    def look_around(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, e: int):
        """Claim a run of entries for what element e is near; a fault if that is more than there is room for."""
        found = wp.zeros(shape=(wp.static(MAX_BODY_CONTACTS),), dtype=wp.int32)
        first = world * grid.near.elements
        i = first + e
        listed = int(0)
        walled = int(0)
        if wp.static(f.pairs):
            listed = grid.near.count[i]
        if wp.static(bool(f.obstacles)):
            walled = grid.near.walled[i]
        count = int(0)
        if listed != 0 or walled != 0:
            count = note_partners(model, state, grid, world, e, listed, walled, found)
        if count > wp.static(MAX_BODY_CONTACTS):
            raise_fault(readout, world, model.contact.body[e], wp.static(int(Fault.OVERFLOW)), grid.clock[world])
            count = wp.static(MAX_BODY_CONTACTS)
        grid.entry.count[i] = count
        if count > 0:
            begin = first * wp.static(MAX_BODY_CONTACTS) + wp.atomic_add(grid.entry.total, world, count)
            grid.entry.begin[i] = begin
            for k in range(count):
                grid.entry.body[begin + k] = wp.vec2i(e, found[k])

    return look_around


def make_entry_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, n)`: make the contact that `look_around` noted as entry n."""
    arm_of, body_pose = arm_term(f), body_pose_term(f)
    sphere_contact = sphere_contact_term(f) if f.pairs else None
    wall_reach = wall_reach_term(f) if f.obstacles else None
    wall_hit = wall_hit_term(f) if f.obstacles else None
    wall_contact = wall_contact_term(f) if f.obstacles else None
    write_entry = write_entry_term(f)

    @wp.func
    def make_entry(model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, n: int):
        """Write entry n, and whether the world's contacts are to be solved."""
        step = grid.clock[world]
        pair = grid.entry.body[n]
        e = pair[0]
        other = pair[1]
        a = model.contact.body[e]
        pose = body_pose(state, world, a)
        if wp.static(f.pairs):
            if other >= 0:
                c = sphere_contact(model, state, readout, grid, world, a, e, other, pose, step)
                write_entry(grid.entry, n, c)
        if wp.static(bool(f.obstacles)):
            if other < 0:
                s = model.contact.sphere[e]
                arm = arm_of(pose, s)
                # the name of an obstacle is its own inverse
                o = obstacle_name(other)
                at = wall_hit(model, o, pose, arm, wall_reach(model, grid, world, a, radius_of(s)), step)
                c = wall_contact(model, readout, grid, world, a, e, o, arm, at, step)
                write_entry(grid.entry, n, c)

    return make_entry
