"""Contact forces of a world whose threads share out its entries: the sweeps of `contacts`, each contact by a thread.

The law of a contact is that of `contacts`. A sweep is two halves, with all threads together in between: entries from
the pushes of both partners, then the pushes of the bodies. As each entry sees both its bodies, it is divided by its own
row sum of G, not by the largest of its neighbourhood. Loads with which no entry is out of its tolerance are kept as
they are, and their pushes: what was looked at is what moves the bodies.
"""

import warp as wp

from otwarp.kernels.contact.contact import SETTLED, UNSETTLED, Contact, along
from otwarp.kernels.contact.excursion import path_tolerance
from otwarp.kernels.contact.travel import lift_of
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import beside, point_of
from otwarp.kernels.core.types import ModelData, Move, ReadoutData, StateData
from otwarp.kernels.drivers.grid.contacts import gap_error
from otwarp.kernels.drivers.grid.data import GridData, PushData
from otwarp.kernels.drivers.grid.entries import (
    DRIFT,
    LAW,
    end_of_entries,
    entry_of,
    first_entry,
    read_ahead,
    read_entry_term,
    read_four,
    read_link,
    read_number,
    read_vector,
    response_term,
    side_of,
    sort_links_term,
    touched_body,
    write_ahead,
    write_four,
    write_number,
    write_vector,
)
from otwarp.kernels.drivers.grid.entry_law import end_root, error_alone, momentum_of, path_reach
from otwarp.kernels.drivers.grid.entry_search import look_again_term, make_entry_term
from otwarp.kernels.drivers.grid.move import two_stages
from otwarp.kernels.drivers.grid.reach import free_opening_term
from otwarp.kernels.drivers.grid.teams import Lane, any_of, meet

SWEEPS = 64
"""Most sweeps over the entries of a world in one solution: as stiff columns of six beads need."""

WEIGHTS = wp.constant(1.0e7)
"""Counts per pN·µm of the sums that scale the first guess: integers, whose sum does not depend on the order."""

MOST_WEIGHT = wp.constant(1.0e9)
"""Most that an entry adds to them [pN·µm]."""

FIRST_SLACK = wp.constant(10.0)
"""Tolerance of a contact in the first of two stages, over that at the end of a step.

The places of the first stage serve to find the drift a second time and no more: an error e of theirs moves a body by
½·(step/relaxation time)·e, at most a tenth of e in steps that are chosen.
"""


def moves_terms(f: Features) -> tuple[wp.Function, wp.Function]:
    """`(push, world, b) -> Move` by contact forces, and `(grid, push, world, b) -> Move` of the whole step."""

    @wp.func
    def pushed(push: PushData, world: int, b: int) -> Move:
        """Move [µm, rad] of body b by its contact forces."""
        move = Move(read_vector(push.linear, world, b), wp.vec3(0.0))
        if wp.static(f.rigid):
            move.angular = read_vector(push.angular, world, b)
        return move

    @wp.func
    def moved(grid: GridData, push: PushData, world: int, b: int) -> Move:
        """Free move and push [µm, rad] of body b."""
        move = pushed(push, world, b)
        move.linear += read_vector(grid.linear, world, b)
        if wp.static(f.rigid):
            move.angular += read_vector(grid.angular, world, b)
        return move

    return pushed, moved


def pushed_opening_term(f: Features) -> wp.Function:
    """`(push, world, c) -> opening` of a contact's gap by the pushes of its partners [µm]."""
    pushed, _ = moves_terms(f)

    @wp.func
    def pushed_opening(push: PushData, world: int, c: Contact) -> float:
        """How far the gap opens by the contact forces so far."""
        total = along(pushed(push, world, c.a), c.arm_a, c.normal)
        if c.b >= 0:
            total -= along(pushed(push, world, c.b), c.arm_b, c.normal)
        return total

    return pushed_opening


def row_sum_term(f: Features) -> wp.Function:
    """`(model, grid, world, n, c) -> row_sum`: how much more a contact's gap gives way to all forces than to its own.

    Σ_j w_j |opening of its gap by force j| / (w·give) over all entries of both its bodies: with these times give as a
    diagonal D, D − G is not negative (Gershgorin, for the basis scaled by the weights w). Those of entries which seem
    to stay without force are small, so that they hold back others little; and these them much.
    """
    response = response_term(f)

    @wp.func
    def share(model: ModelData, grid: GridData, world: int, a: int, arm: wp.vec3, normal: wp.vec3) -> float:
        """Σ w |what force j moves the point at an arm of body a along a normal| [µm/pN]."""
        total = float(0.0)
        for k in range(read_link(grid.entry.links, world, a)):
            link = read_link(grid.entry.link, world * model.bodies + a, k)
            one = response(grid.entry, entry_of(link), side_of(link))
            total += read_number(grid.entry.likely, entry_of(link)) * wp.abs(along(one, arm, normal))
        return total

    @wp.func
    def row_sum_of(model: ModelData, grid: GridData, world: int, n: int, c: Contact) -> float:
        """Row sum over the diagonal, ≥ 1."""
        total = share(model, grid, world, c.a, c.arm_a, c.normal)
        if c.b >= 0:
            total += share(model, grid, world, c.b, c.arm_b, c.normal)
        return wp.where(c.give > 0.0, wp.max(total / (read_number(grid.entry.likely, n) * c.give), 1.0), 1.0)

    return row_sum_of


def gather_term(f: Features) -> wp.Function:
    """`(model, grid, push, turn, world, a)`: the push of a body by the loads from which its entries start in a turn."""
    response = response_term(f)

    @wp.func
    def gather(model: ModelData, grid: GridData, push: PushData, turn: int, world: int, a: int):
        """Write the push [µm, rad] of body a, if it is part of an entry."""
        links = read_link(grid.entry.links, world, a)
        if links > 0:
            total = Move(wp.vec3(0.0), wp.vec3(0.0))
            for k in range(links):
                link = read_link(grid.entry.link, world * model.bodies + a, k)
                ahead = read_ahead(grid.entry.ahead, turn, entry_of(link))
                one = response(grid.entry, entry_of(link), side_of(link))
                total.linear += ahead * one.linear
                total.angular += ahead * one.angular
            write_vector(push.linear, world, a, total.linear)
            if wp.static(f.rigid):
                write_vector(push.angular, world, a, total.angular)

    return gather


@wp.func
def report(model: ModelData, readout: ReadoutData, grid: GridData, world: int, a: int):
    """Net contact force on a body and the sum of its loads [pN]; 0 in a step that solves none."""
    force = wp.vec3(0.0)
    total = float(0.0)
    if grid.touching[world] != 0:
        for k in range(read_link(grid.entry.links, world, a)):
            link = read_link(grid.entry.link, world * model.bodies + a, k)
            law = read_four(grid.entry.part, LAW, entry_of(link))
            load = read_number(grid.entry.load, entry_of(link))
            force += wp.where(side_of(link) == 0, load, -load) * point_of(law)
            total += wp.abs(load)
    readout.contact_force[world, a] = force
    readout.contact_load[world, a] = total


def begin_entry_term(f: Features) -> wp.Function:
    """`(model, grid, push, world, n, lifted)`: what entry n needs to know in all sweeps."""
    free_opening, row_sum_of = free_opening_term(f), row_sum_term(f)
    read_entry, (_, moved) = read_entry_term(f), moves_terms(f)

    @wp.func
    def begin_entry(model: ModelData, grid: GridData, push: PushData, world: int, n: int, lifted: bool):
        """Write the opening by the free moves [µm] and the row sum; `lifted`: by all moves so far, too."""
        c = read_entry(grid.entry, n)
        if wp.static(f.bends):
            if lifted:
                c.lift = lift_of(c, moved(grid, push, world, c.a), moved(grid, push, world, wp.max(c.b, 0)))
                write_four(grid.entry.part, DRIFT, n, beside(c.drift, c.lift))
        write_number(grid.entry.free, n, free_opening(grid, world, c))
        write_number(grid.entry.row_sum, n, row_sum_of(model, grid, world, n, c))

    return begin_entry


def weigh_term(f: Features) -> wp.Function:
    """`(grid, push, world, n)`: add what entry n has to say about the first guess.

    Along λ = α·F the energy of the sweeps is least at α = ΣF(F/k − s₀) / ΣF(F/k + GF), as `contacts.weigh_term` has it.
    """
    pushed_opening, read_entry = pushed_opening_term(f), read_entry_term(f)

    @wp.func
    def weigh(grid: GridData, push: PushData, world: int, n: int):
        """Numerator and denominator of α [pN·µm], as integers."""
        c = read_entry(grid.entry, n)
        if c.stiffness > 0.0 and c.force != 0.0:
            gap = c.force / c.stiffness
            above = c.force * (gap - read_number(grid.entry.free, n))
            below = c.force * (gap + pushed_opening(push, world, c))
            for i in range(2):
                one = wp.clamp(wp.where(i == 0, above, below), -MOST_WEIGHT, MOST_WEIGHT)
                wp.atomic_add(grid.entry.weight, world, i, wp.int64(one * WEIGHTS))

    return weigh


@wp.func
def guess_scale(grid: GridData, world: int) -> float:
    """α ∈ [0, 1] of the first guess λ = α·F, from the sums of `weigh`."""
    above = wp.float32(grid.entry.weight[world, 0])
    scale = float(0.0)
    if above > 0.0:
        scale = wp.min(above / wp.max(wp.float32(grid.entry.weight[world, 1]), 1.0), 1.0)
    return scale


def solve_entry_term(f: Features) -> wp.Function:
    """`(readout, grid, push, sweep, scale, slack, world, n, c) -> int`: one sweep over entry n, 1 if it is to go on.

    It is solved for its force law as if its gap gave way to its own force by row_sum·give and to no other. It counts as
    settled where the load from which the sweep starts is in `slack` times its tolerance.
    """
    pushed_opening = pushed_opening_term(f)

    @wp.func
    def solve_entry(
        readout: ReadoutData, grid: GridData, push: PushData, sweep: int, scale: float, slack: float, world: int,
        n: int, c: Contact,
    ) -> int:  # fmt: skip
        """New load λ [pN], and that from which the next sweep starts; the loads so far are `scale` times themselves."""
        entry = grid.entry
        start = scale * read_ahead(entry.ahead, sweep & 1, n)
        c.load = read_number(entry.load, n)
        row_sum = read_number(entry.row_sum, n)
        opened = read_number(entry.free, n) + scale * pushed_opening(push, world, c)
        reach = path_reach(c, opened, start, row_sum)
        root = end_root(c, opened, start, row_sum, reach)
        load = c.floor + c.hardness * root * root * root
        error = error_alone(c, row_sum, root, reach, load - start)
        if sweep == wp.static(SWEEPS - 1):
            # a free move without bound is the fault that `commit` reports
            if gap_error(c, start, c.overlap - opened) > UNSETTLED * c.radius and finite(grid.linear[world, c.a]):
                raise_fault(readout, world, c.a, wp.static(int(Fault.UNSETTLED)), grid.clock[world])
        ahead = wp.max(load + momentum_of(c, row_sum * c.give, root, start, load, sweep), c.floor)
        write_number(entry.load, n, load)
        write_ahead(entry.ahead, 1 - (sweep & 1), n, ahead)
        return int(error > slack * (wp.static(SETTLED) + path_tolerance(c, reach)))

    return solve_entry


def sweep_term(f: Features) -> wp.Function:
    """`(model, readout, grid, push, me, guess, slack)`: sweeps over the entries of a world until they settle.

    With `guess`, from a share of the forces that they have, else from these; until all are in `slack` times their
    tolerances. Loads and pushes are those from which the last sweep started.
    """
    weigh, gather = weigh_term(f), gather_term(f)
    solve_entry, read_entry = solve_entry_term(f), read_entry_term(f)

    @wp.func
    def sweep_entries(
        model: ModelData, readout: ReadoutData, grid: GridData, push: PushData, me: Lane, guess: bool, slack: float
    ):
        """Each thread keeps its first entry at hand."""
        world = me.world
        lanes = me.lanes
        own = first_entry(grid, world) + me.lane
        last = end_of_entries(grid, world)
        scale = float(1.0)
        if guess:
            for n in range(own, last, lanes):
                weigh(grid, push, world, n)
            meet(me)
            scale = guess_scale(grid, world)
        c = Contact()
        if own < last:
            c = read_entry(grid.entry, own)
        sweep = int(0)
        busy = bool(True)
        while busy:
            moving = int(0)
            for n in range(own, last, lanes):
                if last - own > lanes:
                    c = read_entry(grid.entry, n)
                moving += solve_entry(readout, grid, push, sweep, scale, slack, world, n, c)
            busy = any_of(me, moving) != 0 and sweep < wp.static(SWEEPS - 1)
            if not busy:
                keep_start(grid, me, sweep, scale)
                meet(me)
            if busy or scale != 1.0:
                # for the next sweep, or for a first guess of which a share was enough
                for i in range(me.lane, grid.entry.touches[world], lanes):
                    gather(
                        model,
                        grid,
                        push,
                        wp.where(busy, 1 - (sweep & 1), 0),
                        world,
                        touched_body(model, grid, world, i),
                    )
                meet(me)
            scale = 1.0
            sweep += 1
        if me.lane == 0:
            grid.entry.sweeps[world] = grid.entry.sweeps[world] + sweep

    return sweep_entries


@wp.func
def keep_start(grid: GridData, me: Lane, sweep: int, scale: float):
    """Make the loads of a world's entries those from which a sweep started."""
    for n in range(first_entry(grid, me.world) + me.lane, end_of_entries(grid, me.world), me.lanes):
        start = scale * read_ahead(grid.entry.ahead, sweep & 1, n)
        write_number(grid.entry.load, n, start)
        write_ahead(grid.entry.ahead, 0, n, start)


def make_entries_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, push, me, begin, last, first)`: entries of one world, and who has them."""
    make_entry, sort_links = make_entry_term(f), sort_links_term(f)

    @wp.func
    def make_entries(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, me: Lane,
        begin: int, last: int, first: bool,
    ):  # fmt: skip
        """Make those from `begin` to `last` − 1; what is not of the first solution has no force yet."""
        for n in range(begin + me.lane, last, me.lanes):
            make_entry(model, state, readout, grid, me.world, n)
            if not first:
                write_number(grid.entry.load, n, 0.0)
                write_ahead(grid.entry.ahead, 0, n, 0.0)
        for i in range(me.lane, grid.entry.touches[me.world], me.lanes):
            sort_links(model, grid, push, me.world, touched_body(model, grid, me.world, i))
        if first and me.lane == 0:
            grid.entry.weight[me.world, 0] = wp.int64(0)
            grid.entry.weight[me.world, 1] = wp.int64(0)
        meet(me)

    return make_entries


def settle_entries_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, push, me, again)`: contact forces of a step of one world.

    From what `look_around` claimed or, with `again` 1, from the first solution, after the free moves have changed.
    """
    make_entries, begin_entry = make_entries_term(f), begin_entry_term(f)
    gather, sweep_entries = gather_term(f), sweep_term(f)
    look_again = look_again_term(f) if f.pairs else None

    @wp.func
    def settle_entries(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData, me: Lane,
        again: int,
    ):  # fmt: skip
        """Solve the entries, and again with those whose gaps that has closed, until there are none."""
        world = me.world
        begin = first_entry(grid, world)
        lifted = begin
        last = end_of_entries(grid, world)
        if again != 0:
            begin = last
        first = bool(again == 0)
        slack = wp.where(again == 0, wp.static(FIRST_SLACK if two_stages(f) else 1.0), 1.0)
        more = int(1)
        while more != 0:
            make_entries(model, state, readout, grid, push, me, begin, last, first)
            more = int(0)
            if grid.touching[world] != 0:
                for n in range(first_entry(grid, world) + me.lane, last, me.lanes):
                    begin_entry(model, grid, push, world, n, again != 0 and n >= lifted)
                if first:
                    for i in range(me.lane, grid.entry.touches[world], me.lanes):
                        gather(model, grid, push, 0, world, touched_body(model, grid, world, i))
                meet(me)
                sweep_entries(model, readout, grid, push, me, first, slack)
                if wp.static(f.pairs):
                    for e in range(me.lane, grid.near.elements, me.lanes):
                        more += look_again(model, state, readout, grid, push, world, e, again != 0)
                    more = any_of(me, more)
            first = bool(False)
            begin = last
            lifted = last
            last = end_of_entries(grid, world)

    return settle_entries
