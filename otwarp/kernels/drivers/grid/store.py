"""How a body of the grid driver keeps its list of contacts: whole, or as links where that is enough."""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import Move
from otwarp.kernels.drivers.grid.data import GridData, Link, whole_contacts


@wp.func
def write_contact(grid: GridData, row: int, k: int, c: Contact):
    """Store contact c as entry k of a body's list, with all its fields."""
    grid.contact[row, k] = c


@wp.func
def read_contact(grid: GridData, row: int, k: int, a: int) -> Contact:
    """Entry k of a body's list, as `write_contact` stored it."""
    return grid.contact[row, k]


@wp.func
def write_contact_load(grid: GridData, row: int, k: int, load: float):
    """Store the load λ [pN] of entry k."""
    grid.contact[row, k].load = load


@wp.func
def write_contact_lift(grid: GridData, row: int, k: int, lift: float):
    """Store the lift [µm] of entry k."""
    grid.contact[row, k].lift = lift


@wp.func
def write_link(grid: GridData, row: int, k: int, c: Contact):
    """Store contact c of a lone sphere as a `Link`, without arms, rotations and the partner's response."""
    own = wp.dot(c.response_a.linear, c.normal)
    grid.link[row, k] = Link(
        c.b, c.normal, c.radius, c.overlap, c.hardness, c.force, c.floor, c.stiffness, c.drift, c.curvature, c.ridge,
        c.lift, own, c.give, c.wander, c.layer, c.load,
    )  # fmt: skip


@wp.func
def read_link(grid: GridData, row: int, k: int, a: int) -> Contact:
    """Contact k of the lone sphere a, from its `Link`."""
    link = grid.link[row, k]
    c = Contact()
    c.a = a
    c.b = link.b
    c.normal = link.normal
    c.radius = link.radius
    c.overlap = link.overlap
    c.hardness = link.hardness
    c.force = link.force
    c.floor = link.floor
    c.stiffness = link.stiffness
    c.drift = link.drift
    c.curvature = link.curvature
    c.ridge = link.ridge
    c.lift = link.lift
    c.response_a = Move(link.own * link.normal, wp.vec3(0.0))
    if link.b >= 0:
        c.response_b = Move((link.own - link.give) * link.normal, wp.vec3(0.0))
    c.give = link.give
    c.wander = link.wander
    c.layer = link.layer
    c.load = link.load
    return c


@wp.func
def write_link_load(grid: GridData, row: int, k: int, load: float):
    """Store the load λ [pN] of link k."""
    grid.link[row, k].load = load


@wp.func
def write_link_lift(grid: GridData, row: int, k: int, lift: float):
    """Store the lift [µm] of link k."""
    grid.link[row, k].lift = lift


def peek_terms(f: Features) -> tuple[wp.Function, wp.Function]:
    """`(grid, row, k)` → the other body of entry k, -1 for an obstacle, and → its load [pN]: one number of many."""

    @wp.func
    def partner_of_contact(grid: GridData, row: int, k: int) -> int:
        """Index of the other body of contact k in a body's list, -1 where it is an obstacle."""
        return grid.contact[row, k].b

    @wp.func
    def load_of_contact(grid: GridData, row: int, k: int) -> float:
        """Load λ [pN] of a contact."""
        return grid.contact[row, k].load

    @wp.func
    def partner_of_link(grid: GridData, row: int, k: int) -> int:
        """Index of the other body of link k in a body's list, -1 where it is an obstacle."""
        return grid.link[row, k].b

    @wp.func
    def load_of_link(grid: GridData, row: int, k: int) -> float:
        """Load λ [pN] of a link."""
        return grid.link[row, k].load

    if whole_contacts(f):
        return partner_of_contact, load_of_contact
    return partner_of_link, load_of_link


def contact_store_terms(f: Features) -> tuple[wp.Function, wp.Function, wp.Function, wp.Function]:
    """Write and read entry k of a body's list, write its load, and write its lift.

    `(grid, row, k, c)`, `(grid, row, k, a) -> Contact` and twice `(grid, row, k, value)`. Unless
    `whole_contacts`, an entry holds no arms, and of the responses the body's own along the normal alone.
    """
    if whole_contacts(f):
        return write_contact, read_contact, write_contact_load, write_contact_lift
    return write_link, read_link, write_link_load, write_link_lift
