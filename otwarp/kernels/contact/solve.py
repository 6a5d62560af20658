"""The contact forces of one world and step, solved directly: block principal pivoting with a dense factorisation.

Each contact obeys λ = max(least, F(δ − s)), with s the opening of its gap during the step, itself a result of all λ:
backward Euler. A line stands for the law F, λ = max(least, F − k·s), at first one that solves a lone contact and keeps
a resting one exactly (`contact.anticipate`); where several contacts end elsewhere, the tangent there takes its place
and they are solved again (Newton's method on a convex law, which does not overshoot). For the contacts above their
least load this is (1/k + G) λ = F/k − s₀, with s₀ the opening without contact forces and G the opening of gap i per
unit force in contact j; the matrix is symmetric and positive definite. Gaps that nothing closes stay out of it.

The least load is the adhesion's, or what a thermal excursion within the step asks for (`excursion`). Which contacts
rest on it is found by exchanging all that contradict themselves (Portugal, Júdice, Vicente 1994,
doi:10.1090/S0025-5718-1994-1250776-4) and, should that cycle, one at a time, which cannot (Murty 1974, Opsearch 11,
123).

Iterations need sweeps that grow with the stiffness and with the square of the length of a chain; the factorisation of
the dozen contacts of a squeezed cell costs less than a few sweeps.
"""

import warp as wp

from otwarp.kernels.contact.contact import SETTLED, Contact, along, anticipate, law_error, tangent_at
from otwarp.kernels.contact.excursion import least_load, shared_load
from otwarp.kernels.core.types import Move

BLOCK_ROUNDS = wp.constant(8)
"""Rounds in which all contradicting contacts are exchanged; after them one at a time."""

ROUNDS = wp.constant(64)
"""Most rounds of one step."""

TOLERANCE = wp.constant(SETTLED)

REDUNDANT = wp.constant(1.0e-4)
"""Least pivot relative to the give of its contact. Below it the contact has nothing to hold that others do not hold
already, as the fourth leg of a table, and is yielding by that much: it takes a share of the load that float32 resolves,
and its gap errs by 10⁻⁴ of what the load would move."""

LAW_ROUNDS = wp.constant(8)
"""Most times the contacts are solved with new tangents."""

LAW_TOLERANCE = wp.constant(1.0e-3)
"""Error of a gap, relative to the effective radius, for which a line stands well enough for the force law."""


@wp.func
def coupling(c: Contact, d: Contact) -> float:
    """Opening of the gap of c per unit force in contact d [µm/pN]."""
    total = float(0.0)
    if c.a == d.a:
        total += along(d.response_a, c.arm_a, c.normal)
    if c.a == d.b:
        total += along(d.response_b, c.arm_a, c.normal)
    if c.b >= 0:
        if c.b == d.a:
            total -= along(d.response_a, c.arm_b, c.normal)
        if c.b == d.b:
            total -= along(d.response_b, c.arm_b, c.normal)
    return total


@wp.func
def opening_by_loads(contacts: wp.array(dtype=Contact), count: int, matrix: wp.array(dtype=float), i: int) -> float:
    """Opening of gap i by all contact forces [µm]; G is kept above the diagonal, its diagonal in `give`."""
    total = contacts[i].give * contacts[i].load
    for j in range(i):
        total += matrix[j * count + i] * contacts[j].load
    for j in range(i + 1, count):
        total += matrix[i * count + j] * contacts[j].load
    return total


@wp.func
def factorise(
    contacts: wp.array(dtype=Contact), count: int, pressed: int, matrix: wp.array(dtype=float),
    pivot: wp.array(dtype=float), order: wp.array(dtype=int),
):  # fmt: skip
    """L D Lᵀ of 1/k + G [µm/pN] for the `pressed` contacts in `order`; L is kept below the diagonal, D in `pivot`."""
    for r in range(pressed):
        i = order[r]
        diagonal = contacts[i].give + 1.0 / contacts[i].stiffness
        for q in range(r):
            value = matrix[order[q] * count + i]
            for p in range(q):
                value -= matrix[r * count + p] * matrix[q * count + p]
            # L·D until the row is complete, so that the inner loop has one product
            matrix[r * count + q] = value
        for q in range(r):
            scaled = matrix[r * count + q] / pivot[q]
            diagonal -= scaled * matrix[r * count + q]
            matrix[r * count + q] = scaled
        pivot[r] = wp.max(diagonal, REDUNDANT * contacts[i].give)


@wp.func
def solve_pressed(
    contacts: wp.array(dtype=Contact), count: int, pressed: int, matrix: wp.array(dtype=float),
    right: wp.array(dtype=float), pivot: wp.array(dtype=float), order: wp.array(dtype=int),
):  # fmt: skip
    """Loads [pN] of the `pressed` contacts in `order` from right-hand sides `right` [µm], which are overwritten."""
    factorise(contacts, count, pressed, matrix, pivot, order)
    for r in range(pressed):
        value = right[r]
        for p in range(r):
            value -= matrix[r * count + p] * right[p]
        right[r] = value
    for back in range(pressed):
        r = pressed - 1 - back
        value = right[r] / pivot[r]
        for p in range(r + 1, pressed):
            value -= matrix[p * count + r] * contacts[order[p]].load
        contacts[order[r]].load = value


@wp.func
def contradiction(
    contacts: wp.array(dtype=Contact), count: int, matrix: wp.array(dtype=float), free: float, i: int, on: int
) -> float:
    """Error of gap i [µm] against what its contact was taken for: pressed (`on`), or at its least load."""
    c = contacts[i]
    if c.stiffness == 0.0:
        return 0.0
    if on != 0:
        return (c.least - c.load) * (c.give + 1.0 / c.stiffness)
    return (c.force - c.least) / c.stiffness - free - opening_by_loads(contacts, count, matrix, i)


@wp.func
def opening_by_moves(c: Contact, linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3)) -> float:
    """Opening of a gap by the moves of its bodies and of its obstacle [µm]."""
    opening = along(Move(linear[c.a], angular[c.a]), c.arm_a, c.normal) - c.drift
    if c.b >= 0:
        opening -= along(Move(linear[c.b], angular[c.b]), c.arm_b, c.normal)
    return opening


@wp.func
def swap(contacts: wp.array(dtype=Contact), free: wp.array(dtype=float), on: wp.array(dtype=int), i: int, j: int):
    """Exchange contacts i and j together with their free openings [µm] and pressed marks."""
    if i != j:
        c = contacts[i]
        contacts[i] = contacts[j]
        contacts[j] = c
        opening = free[i]
        free[i] = free[j]
        free[j] = opening
        pressed = on[i]
        on[i] = on[j]
        on[j] = pressed


@wp.func
def prepare(
    contacts: wp.array(dtype=Contact), count: int, linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
    free: wp.array(dtype=float), on: wp.array(dtype=int),
) -> int:  # fmt: skip
    """Fill in the lines and the free openings; at first those are pressed that would be alone.

    Returns how many take part: they are moved to the front. The others are gaps that stay open if nothing pushes.
    """
    held = int(0)
    for i in range(count):
        c = contacts[i]
        opening = opening_by_moves(c, linear, angular)
        c = anticipate(c, opening)
        c.least = least_load(c, opening)
        free[i] = opening
        opened = opening + c.give * (c.least - c.floor)
        on[i] = wp.where(c.stiffness > 0.0 and c.force - c.stiffness * opened > c.least, 1, 0)
        c.load = wp.where(c.stiffness > 0.0, c.least, wp.max(c.force, c.floor))
        contacts[i] = c
        if on[i] != 0 or c.overlap >= 0.0 or c.load != 0.0:
            swap(contacts, free, on, i, held)
            held += 1
    return held


@wp.func
def couple(contacts: wp.array(dtype=Contact), count: int, matrix: wp.array(dtype=float)):
    """Fill in G [µm/pN] above the diagonal: opening of gap i per unit force in contact j."""
    for i in range(count):
        c = contacts[i]
        for j in range(i + 1, count):
            matrix[i * count + j] = coupling(c, contacts[j])


@wp.func
def share_excursions(
    contacts: wp.array(dtype=Contact), count: int, matrix: wp.array(dtype=float), free: wp.array(dtype=float),
    own: wp.array(dtype=float), on: wp.array(dtype=int),
):  # fmt: skip
    """Set the least loads [pN] that keep the excursions of all contacts out together; `own` is scratch."""
    several = int(0)
    for i in range(count):
        c = contacts[i]
        own[i] = least_load(c, free[i]) - c.floor
        if own[i] > 0.0:
            several += 1
    if several > 1:
        for i in range(count):
            if own[i] > 0.0:
                opened = float(0.0)
                for j in range(count):
                    if j != i:
                        opened += wp.max(matrix[wp.min(i, j) * count + wp.max(i, j)], 0.0) * own[j]
                c = contacts[i]
                c.least = c.floor + shared_load(own[i], c.give, opened)
                if on[i] == 0:
                    c.load = c.least
                contacts[i] = c


@wp.func
def solve_lines(
    contacts: wp.array(dtype=Contact), count: int, matrix: wp.array(dtype=float), free: wp.array(dtype=float),
    right: wp.array(dtype=float), pivot: wp.array(dtype=float), order: wp.array(dtype=int), on: wp.array(dtype=int),
) -> float:  # fmt: skip
    """Loads of contacts that follow their lines; the largest error left in a gap [µm], 0 unless the rounds ran out."""
    worst = float(0.0)
    for round in range(ROUNDS):
        pressed = int(0)
        for i in range(count):
            if on[i] != 0:
                order[pressed] = i
                pressed += 1
                contacts[i].load = 0.0
        for r in range(pressed):
            c = contacts[order[r]]
            right[r] = c.force / c.stiffness - free[order[r]] - opening_by_loads(contacts, count, matrix, order[r])
        solve_pressed(contacts, count, pressed, matrix, right, pivot, order)
        worst = float(0.0)
        last = int(0)
        for i in range(count):
            error = contradiction(contacts, count, matrix, free[i], i, on[i])
            # kept apart from `on`, which the errors of the others still need
            right[i] = error
            worst = wp.max(worst, error)
            last = wp.where(error > TOLERANCE, i, last)
        if worst <= TOLERANCE:
            worst = float(0.0)
            break
        for i in range(count):
            if right[i] > TOLERANCE and (round < BLOCK_ROUNDS or i == last):
                on[i] = 1 - on[i]
                contacts[i].load = contacts[i].least
    for i in range(count):
        contacts[i].load = wp.max(contacts[i].load, contacts[i].least)
    return worst


@wp.func
def follow_law(
    contacts: wp.array(dtype=Contact), count: int, error: wp.array(dtype=float), on: wp.array(dtype=int)
) -> float:
    """Tangents for the contacts whose lines miss the force law where they end; the largest error of a gap [µm].

    Where a contact ends follows from its line: at its load if it is pressed, else short of its least load by `error`,
    what `contradiction` found. A least load above what the law asks for there is no error.
    """
    worst = float(0.0)
    for i in range(count):
        c = contacts[i]
        if c.stiffness > 0.0:
            end = c.overlap - (c.force - c.load) / c.stiffness
            if on[i] == 0:
                end = c.overlap - (c.force - c.least) / c.stiffness + error[i]
            held = c.load <= c.least and c.least > c.floor
            if held:
                held = c.hardness * wp.pow(wp.max(end, 0.0), 1.5) <= c.least - c.floor
            if (end > 0.0 or c.load > c.floor) and not held:
                missed = law_error(c, end)
                if missed > LAW_TOLERANCE * c.radius:
                    worst = wp.max(worst, missed)
                    contacts[i] = tangent_at(c, end)
    return worst


@wp.func
def apply_loads(
    contacts: wp.array(dtype=Contact), count: int, sign: float, linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """Add to the moves [µm, rad] of the bodies what the contact forces move (`sign` 1), or take it back (−1)."""
    for i in range(count):
        c = contacts[i]
        load = sign * c.load
        linear[c.a] = linear[c.a] + load * c.response_a.linear
        angular[c.a] = angular[c.a] + load * c.response_a.angular
        if c.b >= 0:
            linear[c.b] = linear[c.b] + load * c.response_b.linear
            angular[c.b] = angular[c.b] + load * c.response_b.angular


@wp.func
def press_closed(
    contacts: wp.array(dtype=Contact), held: int, count: int, linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3), free: wp.array(dtype=float), on: wp.array(dtype=int),
) -> int:  # fmt: skip
    """Press the gaps behind the first `held` contacts that the others pushed closed; their number."""
    more = int(0)
    for i in range(held, count):
        c = contacts[i]
        if c.overlap - opening_by_moves(c, linear, angular) > TOLERANCE:
            on[i] = 1
            swap(contacts, free, on, i, held + more)
            more += 1
    return more


@wp.func
def solve_law(
    contacts: wp.array(dtype=Contact), count: int, matrix: wp.array(dtype=float), free: wp.array(dtype=float),
    right: wp.array(dtype=float), pivot: wp.array(dtype=float), order: wp.array(dtype=int), on: wp.array(dtype=int),
) -> float:  # fmt: skip
    """Loads of contacts that follow their force laws, by lines and then tangents; the largest error of a gap [µm]."""
    worst = float(0.0)
    for _ in range(LAW_ROUNDS):
        worst = solve_lines(contacts, count, matrix, free, right, pivot, order, on)
        if worst > 0.0:
            break
        worst = follow_law(contacts, count, right, on)
        if worst == 0.0:
            break
    return worst


@wp.func
def solve_contacts(
    contacts: wp.array(dtype=Contact), count: int, linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3),
    matrix: wp.array(dtype=float), free: wp.array(dtype=float), right: wp.array(dtype=float),
    pivot: wp.array(dtype=float), order: wp.array(dtype=int), on: wp.array(dtype=int),
) -> float:  # fmt: skip
    """Write the loads of one step, and add what they move to the free moves of the bodies [µm, rad].

    `linear` and `angular` are these moves; the last six arrays are scratch, `matrix` of count² numbers. The contacts
    may change places. Returns the largest error left in a gap [µm]: 0 unless the rounds ran out.
    """
    held = prepare(contacts, count, linear, angular, free, on)
    worst = float(0.0)
    for _ in range(count + 1):
        couple(contacts, held, matrix)
        share_excursions(contacts, held, matrix, free, right, on)
        worst = solve_law(contacts, held, matrix, free, right, pivot, order, on)
        apply_loads(contacts, held, 1.0, linear, angular)
        more = press_closed(contacts, held, count, linear, angular, free, on)
        if more == 0 or worst > 0.0:
            break
        apply_loads(contacts, held, -1.0, linear, angular)
        held += more
    return worst
