"""The contact forces of one world and step, solved directly: block principal pivoting with a dense factorisation.

Each contact obeys λ = max(floor, F(δ − s)), with s the opening of its gap during the step, itself a result of all λ:
backward Euler. A line stands for the law F, λ = max(floor, F − k·s), at first one that solves a lone contact and keeps
a resting one exactly (`contact.anticipate`); where several contacts end elsewhere, the tangent there takes its place
and they are solved again (Newton's method on a convex law, which does not overshoot). For the contacts above their
least load this is (1/k + G) λ = F/k − s₀, with s₀ the opening without contact forces and G the opening of gap i per
unit force in contact j; the matrix is symmetric and positive definite. Gaps that nothing closes stay out of it.

The least load is the adhesion's. A contact whose path is drawn obeys `excursion`'s law instead, by its tangent. Which
contacts rest on their least load is found by exchanging all that contradict themselves (Portugal, Júdice, Vicente 1994,
doi:10.1090/S0025-5718-1994-1250776-4) and, should that cycle, one at a time, which cannot (Murty 1974, Opsearch 11,
123).

Iterations need sweeps that grow with the stiffness and with the square of the length of a chain; the factorisation of
the dozen contacts of a squeezed cell costs less than a few sweeps.
"""

import warp as wp

from otwarp.kernels.bodies.rigid import angular_part, linear_part
from otwarp.kernels.contact.contact import SETTLED, Contact, along, anticipate, law_error, overlap_alone, tangent_at
from otwarp.kernels.contact.excursion import PATH_TOLERANCE, above_least, kept_reach, meets_path, path_tangent
from otwarp.kernels.contact.travel import lift_of
from otwarp.kernels.core.types import Move, vec6

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
        return (c.floor - c.load) * (c.give + 1.0 / c.stiffness)
    return (c.force - c.floor) / c.stiffness - free - opening_by_loads(contacts, count, matrix, i)


@wp.func
def opening_by_moves(c: Contact, linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3)) -> float:
    """Opening of a gap by the moves of its bodies and of its obstacle [µm], along the normal and across."""
    opening = along(Move(linear[c.a], angular[c.a]), c.arm_a, c.normal) - wp.dot(c.drift, c.normal) + c.lift
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
def first_line(c: Contact, opening: float) -> Contact:
    """The contact with the line that solves it if it is alone and free moves open its gap by `opening` [µm]."""
    apart = opening + c.give * c.floor
    if meets_path(c, apart):
        return path_tangent(c, apart)
    return anticipate(c, opening)


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
        c = first_line(c, opening)
        free[i] = opening
        opened = opening + c.give * c.floor
        on[i] = wp.where(c.stiffness > 0.0 and c.force - c.stiffness * opened > c.floor, 1, 0)
        c.load = wp.where(c.stiffness > 0.0, c.floor, wp.max(c.force, c.floor))
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
                contacts[i].load = contacts[i].floor
    for i in range(count):
        contacts[i].load = wp.max(contacts[i].load, contacts[i].floor)
    return worst


@wp.func
def path_error(c: Contact, apart: float) -> float:
    """By how much the load of a contact misses its law [µm], where all but it open the gap by `apart`; 0 if little."""
    reach = kept_reach(c, apart)
    load = float(0.0)
    if reach > 0.0:
        end = overlap_alone(c.hardness, c.give, reach)
        load = c.hardness * end * wp.sqrt(end)
    missed = wp.abs(load - c.load + c.floor) * c.give
    return wp.where(missed > TOLERANCE + PATH_TOLERANCE * above_least(apart, c.wander), missed, 0.0)


@wp.func
def follow_law(
    contacts: wp.array(dtype=Contact), count: int, error: wp.array(dtype=float), on: wp.array(dtype=int)
) -> float:
    """Tangents for the contacts whose lines miss the force law where they end; the largest error of a gap [µm].

    Where a contact ends follows from its line: at its load if it is pressed, else short of its least load by `error`,
    what `contradiction` found.
    """
    worst = float(0.0)
    for i in range(count):
        c = contacts[i]
        if c.stiffness > 0.0:
            opened = (c.force - c.load) / c.stiffness
            if on[i] == 0:
                opened = (c.force - c.floor) / c.stiffness - error[i]
            end = c.overlap - opened
            apart = opened - c.give * (c.load - c.floor)
            missed = float(0.0)
            if meets_path(c, apart):
                missed = path_error(c, apart)
                if missed > 0.0:
                    contacts[i] = path_tangent(c, apart)
            elif end > 0.0 or c.load > c.floor:
                missed = law_error(c, end, LAW_TOLERANCE * c.radius)
                if missed > 0.0:
                    contacts[i] = tangent_at(c, end)
            worst = wp.max(worst, missed)
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
        opening = opening_by_moves(c, linear, angular)
        if kept_reach(c, opening) > TOLERANCE:
            on[i] = 1
            if meets_path(c, opening):
                contacts[i] = path_tangent(c, opening)
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
        worst = solve_law(contacts, held, matrix, free, right, pivot, order, on)
        apply_loads(contacts, held, 1.0, linear, angular)
        more = press_closed(contacts, held, count, linear, angular, free, on)
        if more == 0 or worst > 0.0:
            break
        apply_loads(contacts, held, -1.0, linear, angular)
        held += more
    return worst


@wp.func
def lift_gaps(
    contacts: wp.array(dtype=Contact), count: int, free: wp.array(dtype=vec6), less: wp.array(dtype=vec6)
):  # fmt: skip
    """Write how far the moves `free` − `less` of the bodies [µm, rad] lift the gaps, see `lift_of`.

    These are the noise at first, and whole moves once the contact forces are known: a trap that presses bodies together
    would without them move each far across its other contacts.
    """
    for i in range(count):
        c = contacts[i]
        if c.wander > 0.0 or c.load != 0.0:
            other = wp.max(c.b, 0)
            a = free[c.a] - less[c.a]
            b = free[other] - less[other]
            contacts[i].lift = lift_of(
                c, Move(linear_part(a), angular_part(a)), Move(linear_part(b), angular_part(b))
            )  # fmt: skip
