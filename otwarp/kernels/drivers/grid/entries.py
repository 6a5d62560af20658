"""The contacts of a world as entries that its threads share out, whichever bodies they are of.

A body in a crowd has none or a dozen contacts, so that a thread for each body waits for the longest list. Here threads
search for partners element by element (`entry_search`), then each makes, weighs and solves contacts one by one. A
contact is one entry; a body links to the entries that it is part of, in an order that does not depend on which thread
came first. An entry's numbers are apart in memory, four at a time, so that threads read side by side.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.contiguous import reader, writer
from otwarp.kernels.core.faults import Fault, raise_fault
from otwarp.kernels.core.features import MAX_BODY_CONTACTS, Features
from otwarp.kernels.core.packed import beside, point_of
from otwarp.kernels.core.types import ModelData, Move, ReadoutData
from otwarp.kernels.drivers.grid.data import EntryData, GridData, PushData, whole_contacts

LAW, GIVE, PATH, DRIFT, RIDGE, ARM, OTHER_ARM, LINEAR, OTHER_LINEAR, ANGULAR, OTHER_ANGULAR = range(11)
"""Rows of `EntryData.part`, see `write_entry`; the last six for contacts that move a body in more than one way."""

read_four, write_four = reader(wp.vec4f, 2), writer(wp.vec4f, 2)
read_pair, write_pair = reader(wp.vec2i), writer(wp.vec2i)
read_number, write_number = reader(wp.float32), writer(wp.float32)
read_ahead, write_ahead = reader(wp.float32, 2), writer(wp.float32, 2)
read_link, write_link = reader(wp.int32, 2), writer(wp.int32, 2)
read_vector, write_vector = reader(wp.vec3f, 2), writer(wp.vec3f, 2)


def parts(f: Features) -> int:
    """Rows that an entry has."""
    return 11 if whole_contacts(f) else 5


@wp.func
def give_of(ridge: wp.vec4) -> float:
    """How far a force along the normal moves its own body along it [µm/pN], kept beside the ridge."""
    return ridge[3]


def write_entry_term(f: Features) -> wp.Function:
    """`(entry, n, c)`: store contact c as entry n."""

    @wp.func
    def write_entry(entry: EntryData, n: int, c: Contact):
        """All that a contact has; of responses along the normal alone their lengths."""
        own = wp.dot(c.response_a.linear, c.normal)
        write_pair(entry.body, n, wp.vec2i(c.a, c.b))
        write_four(entry.part, LAW, n, beside(c.normal, c.overlap))
        write_four(entry.part, GIVE, n, wp.vec4(c.give, c.hardness, c.floor, c.stiffness))
        write_four(entry.part, PATH, n, wp.vec4(c.wander, c.layer, c.radius, c.curvature))
        write_four(entry.part, DRIFT, n, beside(c.drift, c.lift))
        write_four(entry.part, RIDGE, n, beside(c.ridge, own))
        if wp.static(whole_contacts(f)):
            write_four(entry.part, ARM, n, beside(c.arm_a, 0.0))
            write_four(entry.part, OTHER_ARM, n, beside(c.arm_b, 0.0))
            write_four(entry.part, LINEAR, n, beside(c.response_a.linear, 0.0))
            write_four(entry.part, OTHER_LINEAR, n, beside(c.response_b.linear, 0.0))
            write_four(entry.part, ANGULAR, n, beside(c.response_a.angular, 0.0))
            write_four(entry.part, OTHER_ANGULAR, n, beside(c.response_b.angular, 0.0))
        write_number(entry.load, n, c.load)
        write_ahead(entry.ahead, 0, n, c.load)

    return write_entry


def response_term(f: Features) -> wp.Function:
    """`(entry, n, side) -> Move`: how the first or second body of entry n moves per unit force [µm/pN, rad/pN]."""

    @wp.func
    def whole_response(entry: EntryData, n: int, side: int) -> Move:
        """Translation [µm/pN] and rotation [rad/pN] of the body per unit force at the contact, along its normal."""
        return Move(
            point_of(read_four(entry.part, LINEAR + side, n)), point_of(read_four(entry.part, ANGULAR + side, n))
        )

    @wp.func
    def response_along(entry: EntryData, n: int, side: int) -> Move:
        """Translation along the contact's normal [µm/pN]."""
        own = give_of(read_four(entry.part, RIDGE, n))
        if side != 0:
            own -= read_four(entry.part, GIVE, n)[0]
        return Move(own * point_of(read_four(entry.part, LAW, n)), wp.vec3(0.0))

    return whole_response if whole_contacts(f) else response_along


def read_entry_term(f: Features) -> wp.Function:
    """`(entry, n) -> Contact` as `write_entry` stored it; `force` is the load that it has."""
    response = response_term(f)

    @wp.func
    def read_entry(entry: EntryData, n: int) -> Contact:
        """Entry n; what is not used of it is not read."""
        c = Contact()
        pair, drift = read_pair(entry.body, n), read_four(entry.part, DRIFT, n)
        law, give, path = read_four(entry.part, LAW, n), read_four(entry.part, GIVE, n), read_four(entry.part, PATH, n)
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
        c.ridge = point_of(read_four(entry.part, RIDGE, n))
        if wp.static(whole_contacts(f)):
            c.arm_a = point_of(read_four(entry.part, ARM, n))
            c.arm_b = point_of(read_four(entry.part, OTHER_ARM, n))
        c.response_a = response(entry, n, 0)
        if c.b >= 0:
            c.response_b = response(entry, n, 1)
        c.load = read_number(entry.load, n)
        c.force = c.load
        return c

    return read_entry


@wp.func
def first_entry(grid: GridData, world: int) -> int:
    """Where the entries of a world begin."""
    return world * grid.near.elements * wp.static(MAX_BODY_CONTACTS)


@wp.func
def end_of_entries(grid: GridData, world: int) -> int:
    """One past the last entry of a world."""
    most = grid.near.elements * wp.static(MAX_BODY_CONTACTS)
    return first_entry(grid, world) + wp.min(grid.entry.total[world], most)


@wp.func
def entry_of(link: int) -> int:
    """The entry of a link, which names with it the side that its body is on."""
    return link >> 1


@wp.func
def side_of(link: int) -> int:
    """Whether the body of a link is the first of its entry, 0, or the second, 1."""
    return link & 1


@wp.func
def link(readout: ReadoutData, grid: GridData, world: int, row: int, a: int, n: int, side: int):
    """Note in the row of body a that it is on a side of entry n; a fault if there is no room for it."""
    k = wp.atomic_add(grid.count, world, a, 1)
    if k == 0:
        bodies = grid.count.shape[1]
        grid.entry.touched[world * bodies + wp.atomic_add(grid.entry.touches, world, 1)] = a
    if k < wp.static(MAX_BODY_CONTACTS):
        write_link(grid.entry.link, row, k, 2 * n + side)
    else:
        raise_fault(readout, world, a, wp.static(int(Fault.OVERFLOW)), grid.clock[world])


@wp.func
def claim(model: ModelData, readout: ReadoutData, grid: GridData, world: int, e: int, other: int):
    """Claim an entry for element e and `other`: an element or an `obstacle_name`."""
    k = wp.atomic_add(grid.entry.total, world, 1)
    if k < grid.near.elements * wp.static(MAX_BODY_CONTACTS):
        n = first_entry(grid, world) + k
        write_pair(grid.entry.pair, n, wp.vec2i(e, other))
        a = model.contact.body[e]
        link(readout, grid, world, world * model.bodies + a, a, n, 0)
        if other >= 0:
            b = model.contact.body[other]
            link(readout, grid, world, world * model.bodies + b, b, n, 1)


@wp.func
def touched_body(model: ModelData, grid: GridData, world: int, i: int) -> int:
    """Body i of those of a world that are part of entries, in no order: each is gathered by itself."""
    return grid.entry.touched[world * model.bodies + i]


@wp.func
def no_entries(grid: GridData, world: int):
    """Begin a step of a world without entries."""
    grid.touching[world] = 0
    grid.entry.total[world] = 0
    grid.entry.touches[world] = 0


@wp.func
def comes_after(one: wp.vec2i, other: wp.vec2i) -> bool:
    """Whether a pair of elements comes after another, by its first element, then by its second."""
    return one[0] > other[0] or (one[0] == other[0] and one[1] > other[1])


def sort_links_term(f: Features) -> wp.Function:
    """`(model, grid, push, world, a)`: count the links of a body, in an order of their own; a new one is not pushed."""

    @wp.func
    def sort_links(model: ModelData, grid: GridData, push: PushData, world: int, a: int):
        """Put links in the order of their pairs: sums over them depend on it in the last bit."""
        row = world * model.bodies + a
        links = wp.min(read_link(grid.count, world, a), wp.static(MAX_BODY_CONTACTS))
        if links > 0 and read_link(grid.entry.links, world, a) == 0:
            write_vector(push.linear, world, a, wp.vec3(0.0))
            if wp.static(f.rigid):
                write_vector(push.angular, world, a, wp.vec3(0.0))
        write_link(grid.entry.links, world, a, links)
        for i in range(1, links):
            n = read_link(grid.entry.link, row, i)
            own = read_pair(grid.entry.pair, entry_of(n))
            k = int(i)
            while k > 0 and comes_after(
                read_pair(grid.entry.pair, entry_of(read_link(grid.entry.link, row, wp.max(k - 1, 0)))), own
            ):
                write_link(grid.entry.link, row, k, read_link(grid.entry.link, row, k - 1))
                k -= 1
            write_link(grid.entry.link, row, k, n)

    return sort_links
