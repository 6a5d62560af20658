"""Contact forces of bodies that are coupled through the liquid: each of them carries all bodies of the world along.

The friction that contact forces overcome is the one that noise has; with another one, bodies that touch would not be
distributed as Boltzmann has them. Everything else is as in `solve`.
"""

import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.solve import apply_loads, couple, prepare, press_closed, solve_law
from otwarp.kernels.hydrodynamics.coupling import block_at


@wp.func
def carried_by(pair: wp.array(dtype=wp.mat33), i: int, j: int, force: wp.vec3) -> wp.vec3:
    """Displacement [µm] of body i in one step by a force [pN] on body j; 0 if j is i itself, or an obstacle (−1)."""
    v = wp.vec3(0.0)
    if i != j and j >= 0:
        v = pair[block_at(wp.max(i, j), wp.min(i, j))] * force
    return v


@wp.func
def carried_by_contact(pair: wp.array(dtype=wp.mat33), i: int, c: Contact) -> wp.vec3:
    """Displacement of body i per unit force of contact c on other bodies [µm/pN]."""
    return carried_by(pair, i, c.a, c.normal) - carried_by(pair, i, c.b, c.normal)


@wp.func
def opening_by_carrying(pair: wp.array(dtype=wp.mat33), c: Contact, d: Contact) -> float:
    """Opening of the gap of c by what a unit force in contact d carries along [µm/pN]; symmetric in c and d."""
    opening = wp.dot(c.normal, carried_by_contact(pair, c.a, d))
    if c.b >= 0:
        opening -= wp.dot(c.normal, carried_by_contact(pair, c.b, d))
    return opening


@wp.func
def carry_gives(contacts: wp.array(dtype=Contact), count: int, pair: wp.array(dtype=wp.mat33)):
    """Let new contacts give way as their two bodies do together, which is less than each by itself.

    Thermal excursions were drawn for bodies on their own; their variance is proportional to the give.
    """
    for i in range(count):
        c = contacts[i]
        alone = c.give
        c.give += opening_by_carrying(pair, c, c)
        c.wander *= c.give / alone
        contacts[i] = c


@wp.func
def carry_bodies(
    contacts: wp.array(dtype=Contact), count: int, bodies: int, sign: float, pair: wp.array(dtype=wp.mat33),
    linear: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """Add to the moves [µm] what the contact forces carry along (`sign` 1), or take it back (−1)."""
    for i in range(count):
        c = contacts[i]
        for b in range(bodies):
            linear[b] = linear[b] + (sign * c.load) * carried_by_contact(pair, b, c)


@wp.func
def solve_coupled_contacts(
    contacts: wp.array(dtype=Contact), count: int, bodies: int, pair: wp.array(dtype=wp.mat33),
    linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3), matrix: wp.array(dtype=float),
    free: wp.array(dtype=float), right: wp.array(dtype=float), pivot: wp.array(dtype=float), order: wp.array(dtype=int),
    on: wp.array(dtype=int),
) -> float:  # fmt: skip
    """Largest error left in a gap [µm], as `solve.solve_contacts`; `pair` as `coupling.fill_pairs` left it."""
    held = prepare(contacts, count, linear, angular, free, on)
    worst = float(0.0)
    for _ in range(count + 1):
        couple(contacts, held, matrix)
        for i in range(held):
            for j in range(i + 1, held):
                more_open = opening_by_carrying(pair, contacts[i], contacts[j])
                matrix[i * held + j] = matrix[i * held + j] + more_open
        worst = solve_law(contacts, held, matrix, free, right, pivot, order, on)
        apply_loads(contacts, held, 1.0, linear, angular)
        carry_bodies(contacts, held, bodies, 1.0, pair, linear)
        more = press_closed(contacts, held, count, linear, angular, free, on)
        if more == 0 or worst > 0.0:
            break
        apply_loads(contacts, held, -1.0, linear, angular)
        carry_bodies(contacts, held, bodies, -1.0, pair, linear)
        held += more
    return worst
