"""Contact forces of a world whose threads share out its entries: the sweeps of `contacts`, each contact by a thread.

The law of a contact, its momentum and the error at which it counts as settled are those of `contacts`. A sweep is two
halves, with all threads together in between: entries from the pushes of both partners, then the pushes of the bodies
whose entries have changed. An entry between bodies that two sweeps have left at rest sleeps until one of them stirs, so
that the last island to settle does not keep the others busy.
"""

import warp as wp

from otwarp.kernels.contact.contact import SETTLED, UNSETTLED, Contact, along
from otwarp.kernels.contact.excursion import path_tolerance, swept_reach
from otwarp.kernels.contact.travel import lift_of
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import MAX_BODY_CONTACTS, Features
from otwarp.kernels.core.packed import point_of
from otwarp.kernels.core.types import ModelData, Move, ReadoutData
from otwarp.kernels.drivers.grid.contacts import (
    at_rest,
    end_overlap,
    gap_error,
    guess_scale,
    momentum_of,
    reset_sweeps,
)
from otwarp.kernels.drivers.grid.data import GridData, PushData
from otwarp.kernels.drivers.grid.entries import DRIFT, read_entry_term, response_term
from otwarp.kernels.drivers.grid.reach import free_opening_term
from otwarp.kernels.drivers.world import keep_together

_ASLEEP = wp.constant(-9)
"""Sweep in which a body stirred that has not."""


def moves_terms(f: Features) -> tuple[wp.Function, wp.Function]:
    """`(push, world, b) -> Move` by contact forces, and `(grid, push, world, b) -> Move` of the whole step."""

    @wp.func
    def pushed(push: PushData, world: int, b: int) -> Move:
        """Move [µm, rad] of body b by its contact forces."""
        move = Move(push.linear[world, b], wp.vec3(0.0))
        if wp.static(f.rigid):
            move.angular = push.angular[world, b]
        return move

    @wp.func
    def moved(grid: GridData, push: PushData, world: int, b: int) -> Move:
        """Free move and push [µm, rad] of body b."""
        move = pushed(push, world, b)
        move.linear += grid.linear[world, b]
        if wp.static(f.rigid):
            move.angular += grid.angular[world, b]
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


def ratio_term(f: Features) -> wp.Function:
    """`(model, grid, world, n)`: how much more a body gives way to all its entries at once than to entry n alone."""
    read_entry, response = read_entry_term(f), response_term(f)

    @wp.func
    def ratio(model: ModelData, grid: GridData, world: int, n: int):
        """Σ_m |response of the gap of n to force m| / |its response to its own|, a bound by Gershgorin's theorem."""
        c = read_entry(grid.entry, n)
        own = along(c.response_a, c.arm_a, c.normal)
        total = float(0.0)
        for e in range(model.contact.start[c.a], model.contact.start[c.a + 1]):
            i = world * grid.near.elements + e
            begin = grid.entry.begin[i]
            for m in range(begin, begin + grid.entry.count[i]):
                total += wp.abs(along(response(grid.entry, m), c.arm_a, c.normal))
        grid.entry.row_sum[n] = wp.where(own > 0.0, total / own, 1.0)

    return ratio


def gather_term(f: Features) -> wp.Function:
    """`(model, grid, push, world, a) -> int`: the push of a body by the loads from which its entries start next."""
    response = response_term(f)

    @wp.func
    def gather(model: ModelData, grid: GridData, push: PushData, world: int, a: int) -> int:
        """Write the push [µm, rad] of body a, in the order of its entries; how many these are."""
        total = Move(wp.vec3(0.0), wp.vec3(0.0))
        count = int(0)
        for e in range(model.contact.start[a], model.contact.start[a + 1]):
            i = world * grid.near.elements + e
            begin = grid.entry.begin[i]
            for n in range(begin, begin + grid.entry.count[i]):
                one = response(grid.entry, n)
                total.linear += grid.entry.ahead[n] * one.linear
                total.angular += grid.entry.ahead[n] * one.angular
            count += grid.entry.count[i]
        push.linear[world, a] = total.linear
        if wp.static(f.rigid):
            push.angular[world, a] = total.angular
        return count

    return gather


@wp.func
def report(model: ModelData, readout: ReadoutData, grid: GridData, world: int, a: int):
    """Net contact force on a body and the sum of its loads [pN]; 0 in a step that solves none."""
    force = wp.vec3(0.0)
    total = float(0.0)
    if grid.touching[world] != 0:
        for e in range(model.contact.start[a], model.contact.start[a + 1]):
            i = world * grid.near.elements + e
            begin = grid.entry.begin[i]
            for n in range(begin, begin + grid.entry.count[i]):
                law = grid.entry.part[0, n]
                load = grid.entry.load[n]
                force += load * point_of(law)
                total += wp.abs(load)
    readout.contact_force[world, a] = force
    readout.contact_load[world, a] = total


@wp.func
def wake(model: ModelData, grid: GridData, world: int, a: int):
    """Forget when body a stirred last, and what its entries did."""
    grid.entry.mark[world, a] = -1
    grid.entry.stir[world, a] = _ASLEEP


def begin_sweeps_term(f: Features) -> wp.Function:
    """`(model, grid, push, world, n, again)`: what entry n needs to know in all sweeps, and its share of `guess_scale`.

    Along λ = α·F the energy of the sweeps is least at α = ΣF(F/k − s₀) / ΣF(F/k + GF), as `contacts.weigh_term` has it.
    """
    free_opening, pushed_opening = free_opening_term(f), pushed_opening_term(f)
    read_entry, (_, moved) = read_entry_term(f), moves_terms(f)

    @wp.func
    def begin_sweeps(model: ModelData, grid: GridData, push: PushData, world: int, n: int, again: int):
        """Write opening by the free moves [µm], the larger row sum of both partners, and F·(…) [pN·µm]."""
        entry = grid.entry
        c = read_entry(entry, n)
        if wp.static(f.bends):
            if again != 0:
                c.lift = lift_of(c, moved(grid, push, world, c.a), moved(grid, push, world, wp.max(c.b, 0)))
                entry.part[DRIFT, n] = wp.vec4(c.drift[0], c.drift[1], c.drift[2], c.lift)
        free = free_opening(grid, world, c)
        entry.free[n] = free
        if again == 0:
            row_sum = grid.row_sum[world, c.a]
            if c.b >= 0:
                row_sum = wp.max(row_sum, grid.row_sum[world, c.b])
            entry.row_sum[n] = row_sum
            share = wp.vec2(0.0)
            if c.stiffness > 0.0:
                gap = c.force / c.stiffness
                share = (
                    wp.where(c.b >= 0, 0.5, 1.0) * c.force * wp.vec2(gap - free, gap + pushed_opening(push, world, c))
                )
            entry.share[n] = share

    return begin_sweeps


@wp.func
def weigh_chunk(model: ModelData, grid: GridData, world: int, chunk: int):
    """Sum what the entries of a chunk of bodies weigh [pN·µm], in an order that is fixed."""
    size = (model.bodies - 1) // grid.share.shape[1] + 1
    total = wp.vec2(0.0)
    # the last chunks may be empty
    first = model.contact.start[wp.min(chunk * size, model.bodies)]
    for e in range(first, model.contact.start[wp.min((chunk + 1) * size, model.bodies)]):
        i = world * grid.near.elements + e
        begin = grid.entry.begin[i]
        for n in range(begin, begin + grid.entry.count[i]):
            total += grid.entry.share[n]
    grid.share[world, chunk] = total


def solve_entry_term(f: Features) -> wp.Function:
    """`(readout, grid, push, sweep, scale, world, n)`: one sweep over entry n, unless it sleeps.

    It is solved for its force law as if its gap gave way to its own force by row_sum·give and to no other.
    """
    read_entry, pushed_opening = read_entry_term(f), pushed_opening_term(f)

    @wp.func
    def awake(grid: GridData, sweep: int, world: int, pair: wp.vec2i) -> bool:
        """Whether a partner has stirred in the last two sweeps."""
        stirred = grid.entry.stir[world, pair[0]]
        if pair[1] >= 0:
            stirred = wp.max(stirred, grid.entry.stir[world, pair[1]])
        return sweep < 2 or stirred >= sweep - 2

    @wp.func
    def solve_entry(readout: ReadoutData, grid: GridData, push: PushData, sweep: int, scale: float, world: int, n: int):
        """New load λ [pN], and that from which the next sweep starts; the loads so far are `scale` times themselves."""
        entry = grid.entry
        if awake(grid, sweep, world, entry.body[n]):
            c = read_entry(entry, n)
            last = sweep == grid.moving.shape[1] - 1
            start = scale * entry.ahead[n]
            row_sum = entry.row_sum[n]
            opened = entry.free[n] + scale * pushed_opening(push, world, c)
            reach = swept_reach(c, opened, start, row_sum)
            end = end_overlap(c, opened, start, row_sum, reach)
            load = c.floor + c.hardness * end * wp.sqrt(end)
            mark = 2 * sweep
            if wp.abs(load - start) * c.give > wp.static(SETTLED) + path_tolerance(c, reach):
                grid.moving[world, sweep] = 1
                mark += 1
            wp.atomic_max(entry.mark, world, c.a, mark)
            ahead = load
            if last:
                # a free move without bound is the fault that `commit` reports
                if gap_error(c, start, c.overlap - opened) > UNSETTLED * c.radius and finite(grid.linear[world, c.a]):
                    raise_fault(readout, world, c.a, wp.static(int(Fault.UNSETTLED)), grid.clock[world])
            else:
                ahead += momentum_of(c, row_sum * c.give, end, start, load, sweep)
            entry.load[n] = load
            entry.ahead[n] = ahead

    return solve_entry


def begin_all_term(f: Features) -> wp.Function:
    """`(model, grid, push, world, lane, lanes, last)`: row sums and first pushes of the bodies of a world."""
    ratio, gather = ratio_term(f), gather_term(f)

    @wp.func
    def begin_all(model: ModelData, grid: GridData, push: PushData, world: int, lane: int, lanes: int, last: int):
        """Row sums and first pushes of the bodies of a world; `last` is one past its last entry."""
        first = world * grid.near.elements * wp.static(MAX_BODY_CONTACTS)
        for n in range(first + lane, last, lanes):
            ratio(model, grid, world, n)
        keep_together()
        for a in range(lane, model.bodies, lanes):
            largest = float(1.0)
            for e in range(model.contact.start[a], model.contact.start[a + 1]):
                i = world * grid.near.elements + e
                begin = grid.entry.begin[i]
                for n in range(begin, begin + grid.entry.count[i]):
                    largest = wp.max(largest, grid.entry.row_sum[n])
            grid.row_sum[world, a] = largest
            grid.count[world, a] = gather(model, grid, push, world, a)
        keep_together()

    return begin_all


def settle_entries_term(f: Features) -> wp.Function:
    """`(model, readout, grid, push, world, lane, lanes, again)`: contact forces of a step of one world.

    From a first guess or, with `again` 1, from those of its first solution, after the free moves have changed.
    """
    begin_all, gather = begin_all_term(f), gather_term(f)
    begin_sweeps, solve_entry = begin_sweeps_term(f), solve_entry_term(f)

    @wp.func
    def settle_entries(
        model: ModelData, readout: ReadoutData, grid: GridData, push: PushData, world: int, lane: int, lanes: int,
        again: int,
    ):  # fmt: skip
        """Sweep over the entries of a world until they are settled."""
        first = world * grid.near.elements * wp.static(MAX_BODY_CONTACTS)
        last = first + grid.entry.total[world]
        if again == 0:
            begin_all(model, grid, push, world, lane, lanes, last)
        for a in range(lane, model.bodies, lanes):
            wake(model, grid, world, a)
        for n in range(first + lane, last, lanes):
            begin_sweeps(model, grid, push, world, n, again)
        if lane == 0:
            reset_sweeps(grid, world)
        keep_together()
        scale = float(1.0)
        if again == 0:
            for chunk in range(lane, grid.share.shape[1], lanes):
                weigh_chunk(model, grid, world, chunk)
            keep_together()
            scale = guess_scale(grid, world)
        sweep = int(0)
        while sweep < grid.moving.shape[1] and not at_rest(grid, world, sweep):
            for n in range(first + lane, last, lanes):
                solve_entry(readout, grid, push, sweep, scale, world, n)
            keep_together()
            for a in range(lane, model.bodies, lanes):
                mark = grid.entry.mark[world, a]
                if mark >= 2 * sweep:
                    gather(model, grid, push, world, a)
                    if mark > 2 * sweep:
                        grid.entry.stir[world, a] = sweep
            keep_together()
            scale = 1.0
            sweep += 1

    return settle_entries
