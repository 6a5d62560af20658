"""Contact forces of the grid driver: sweeps over the contacts that `lists` found, until they are settled.

The forces are λ = F(δ − s): Hertz's law at the end of the step, where the gaps have opened by s under all λ. They are
the minimum of a convex energy, ½ λᵀGλ − λᵀ(δ − s₀) + Σψ*(λ) with G the opening of gap i per unit force in contact j, s₀
the opening without contact forces and ψ*' the overlap that belongs to a force.
The sweeps are accelerated proximal gradient steps on it (Beck, Teboulle 2009, doi:10.1137/080716542; for contact:
Mazhar, Heyn, Negrut, Tasora 2015, doi:10.1145/2735627), with row_sum·give, by Gershgorin's theorem at least the row
sum of G, for G: no stiffness makes them diverge, and a lone contact is solved at once. Thermal excursions (`excursion`)
are laws of force that fall with the gap, as Hertz's is, and so part of the same energy. Momentum restarts contact by
contact where it points uphill (O'Donoghue, Candès 2015, doi:10.1007/s10208-013-9150-3). A step without contacts takes
no sweep, a settled one no more.
"""

import warp as wp

from otwarp.kernels.contact.contact import SETTLED, UNSETTLED, Contact, along, overlap_alone
from otwarp.kernels.contact.excursion import path_tolerance, swept_reach
from otwarp.kernels.contact.travel import lift_of
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, Move, ReadoutData
from otwarp.kernels.drivers.grid.data import GridData, PushData, own_term
from otwarp.kernels.drivers.grid.reach import free_opening_term
from otwarp.kernels.drivers.grid.store import contact_store_terms

RELAXATIONS = 32
"""Most sweeps over the contacts in one step (even, because they write to two buffers in turn)."""

CHUNKS = 64
"""Parts into which the bodies of a world are divided for sums over all contacts."""


def push_term(f: Features) -> wp.Function:
    """`(grid, push, world, b) -> Move`: what contacts move a body."""

    @wp.func
    def push_of(grid: GridData, push: PushData, world: int, b: int) -> Move:
        """Move [µm, rad] of body b by its contact forces; 0 without contacts."""
        move = Move(wp.vec3(0.0), wp.vec3(0.0))
        # where rounding let only one partner of a gap list it, the other has no push of this step
        if wp.static(f.in_turn) or grid.count[world, b] > 0:
            move.linear = push.linear[world, b]
            if wp.static(f.rigid):
                move.angular = push.angular[world, b]
        return move

    return push_of


def move_term(f: Features) -> wp.Function:
    """`(grid, push, world, b) -> Move`: the whole move of a body in this step."""
    push_of = push_term(f)

    @wp.func
    def move_of(grid: GridData, push: PushData, world: int, b: int) -> Move:
        """Free move and push [µm, rad] of body b."""
        move = push_of(grid, push, world, b)
        move.linear += grid.linear[world, b]
        if wp.static(f.rigid):
            move.angular += grid.angular[world, b]
        return move

    return move_of


def opening_term(f: Features) -> wp.Function:
    """`(grid, push, world, c, scale) -> opening` of a contact's gap by all displacements of this step [µm]."""
    free_opening, push_of = free_opening_term(f), push_term(f)

    @wp.func
    def opening(grid: GridData, push: PushData, world: int, c: Contact, scale: float) -> float:
        """Opening [µm] of the gap by the free moves and `scale` times the pushes of both partners."""
        total = along(push_of(grid, push, world, c.a), c.arm_a, c.normal)
        if c.b >= 0:
            total -= along(push_of(grid, push, world, c.b), c.arm_b, c.normal)
        return free_opening(grid, world, c) + scale * total

    return opening


def weigh_term(f: Features) -> wp.Function:
    """`(model, grid, push, world, chunk)`: the sums from which `guess_scale` follows, in an order that is fixed.

    Along λ = α·F the energy of the sweeps is least at α = ΣF(F/k − s₀) / ΣF(F/k + GF): 1 for what is squeezed or at
    rest, little where an impact would throw stiff bodies far. A contact of two bodies is in both lists, half in each.
    """
    opening = opening_term(f)
    read_contact = contact_store_terms(f)[1]

    @wp.func
    def weigh_chunk(model: ModelData, grid: GridData, push: PushData, world: int, chunk: int):
        """Numerator and denominator of α [pN·µm] over one chunk of bodies."""
        size = (model.bodies - 1) // grid.share.shape[1] + 1
        total = wp.vec2(0.0)
        for a in range(chunk * size, wp.min((chunk + 1) * size, model.bodies)):
            row = world * model.bodies + a
            for i in range(grid.count[world, a]):
                c = read_contact(grid, row, i, a)
                if c.stiffness > 0.0:
                    free = opening(grid, push, world, c, 0.0)
                    pushed = opening(grid, push, world, c, 1.0) - free
                    gap = c.force / c.stiffness
                    total += wp.where(c.b >= 0, 0.5, 1.0) * c.force * wp.vec2(gap - free, gap + pushed)
        grid.share[world, chunk] = total

    return weigh_chunk


def make_weigh(f: Features) -> wp.Kernel:
    """Kernel over (world, chunk of bodies): what the sweeps of a step begin with."""
    weigh_chunk = weigh_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def weigh(model: ModelData, grid: GridData, push: PushData):
        """Weigh one chunk of a world's bodies; chunk 0 also resets the sweeps."""
        world, chunk = wp.tid()
        weigh_chunk(model, grid, push, world, chunk)
        if chunk == 0:
            reset_sweeps(grid, world)
        if world == 0 and chunk == 0:
            call_sweeps(grid, 0)

    return weigh


@wp.func
def reset_sweeps(grid: GridData, world: int):
    """No contact of a world is known to move in any of the sweeps to come."""
    for sweep in range(grid.moving.shape[1]):
        grid.moving[world, sweep] = 0


@wp.func
def call_sweeps(grid: GridData, again: int):
    """Begin the sweeps of all worlds; `again` is 1 for those after the first solution of a step."""
    for sweep in range(grid.active.shape[0]):
        grid.active[sweep] = 0
    grid.sweep[0] = 0
    grid.unsettled[0] = 1
    grid.again[0] = again


@wp.func
def resume(grid: GridData, world: int):
    """Make the first guess of a world's next sweeps the forces that it has."""
    for chunk in range(grid.share.shape[1]):
        grid.share[world, chunk] = wp.where(chunk == 0, wp.vec2(1.0, 1.0), wp.vec2(0.0, 0.0))


@wp.func
def at_rest(grid: GridData, world: int, sweep: int) -> bool:
    """Whether a world needs no sweep: two were at rest, so that both push buffers hold the solution."""
    rest = bool(False)
    if sweep > 1:
        rest = grid.moving[world, sweep - 1] == 0 and grid.moving[world, sweep - 2] == 0
    return rest


@wp.func
def guess_scale(grid: GridData, world: int) -> float:
    """α ∈ [0, 1] of the first guess λ = α·F, from the sums of `weigh`."""
    total = wp.vec2(0.0)
    for chunk in range(grid.share.shape[1]):
        total += grid.share[world, chunk]
    scale = float(0.0)
    if total[0] > 0.0:
        scale = wp.min(total[0] / wp.max(total[1], 1.0e-30), 1.0)
    return scale


@wp.func
def gap_error(c: Contact, load: float, overlap: float) -> float:
    """How far from the overlap that belongs to a load the contact ends with it [µm]."""
    above = wp.max(load - c.floor, 0.0) / c.hardness
    wanted = wp.pow(above, 2.0 / 3.0)
    error = wp.max(overlap, 0.0) - wanted
    # an excursion may ask for more than the overlap does
    return wp.where(c.wander > 0.0, wp.max(error, 0.0), wp.abs(error))


@wp.func
def end_overlap(c: Contact, opened: float, start: float, row_sum: float, reach: float) -> float:
    """Overlap [µm] at which a contact ends whose gap a load of `start` [pN] leaves open by `opened` [µm].

    Of what swept over `reach` [µm] it is that of the contact alone; else backward Euler's, as if the gap gave way by
    row_sum·give.
    """
    end = float(0.0)
    give = row_sum * c.give
    alone = c.overlap - opened + give * (start - c.floor)
    if reach > 0.0:
        end = overlap_alone(c.hardness, c.give, reach)
    elif alone > 0.0:
        end = overlap_alone(c.hardness, give, alone)
    return end


@wp.func
def momentum_of(c: Contact, give: float, end: float, start: float, load: float, sweep: int) -> float:
    """What a sweep that led from `start` to `load` adds for the next [pN]; none where it went too far: restart."""
    root = wp.sqrt(1.0 + 1.5 * give * c.hardness * wp.sqrt(end))
    share = wp.min((root - 1.0) / (root + 1.0), float(sweep) / float(sweep + 3))
    return wp.where((start - load) * (load - c.load) <= 0.0, share * (load - c.load), 0.0)


@wp.func
def larger_row_sum(grid: GridData, world: int, c: Contact) -> float:
    """Larger `row_sum` of the two partners of a contact, ≥ 1."""
    row_sum = grid.row_sum[world, c.a]
    if c.b >= 0:
        row_sum = wp.max(row_sum, grid.row_sum[world, c.b])
    return row_sum


def lift_term(f: Features) -> wp.Function:
    """`(grid, push, world, c) -> lift` of a gap by the free moves and the pushes of both partners, see `lift_of`."""
    move_of = move_term(f)

    @wp.func
    def lift(grid: GridData, push: PushData, world: int, c: Contact) -> float:
        """Opening [µm] by motion across the normal, with contact forces as they are so far."""
        return lift_of(c, move_of(grid, push, world, c.a), move_of(grid, push, world, wp.max(c.b, 0)))

    return lift


def present_contact_term(f: Features) -> wp.Function:
    """`(grid, push, world, row, i, a, sweep) -> c`: contact i of body a, its lift that of the stage that begins."""
    lift = lift_term(f) if f.bends else None
    own = own_term(f)
    _, read_contact, _, write_lift = contact_store_terms(f)

    @wp.func
    def present_contact(grid: GridData, push: PushData, world: int, row: int, i: int, a: int, sweep: int) -> Contact:
        """A contact as it is kept; the first sweep of a second stage finds how far motion lifts it [µm] anew."""
        c = read_contact(grid, row, i, a)
        if wp.static(f.bends):
            if sweep == 0 and grid.again[own(world)] != 0:
                c.lift = lift(grid, push, world, c)
                write_lift(grid, row, i, c.lift)
        return c

    return present_contact


def relax_body_term(f: Features) -> wp.Function:
    """`(model, readout, grid, before, after, sweep, world, a)`: one sweep over the contacts of one body.

    Each contact is solved for its force law, as if its gap gave way to its own force by row_sum·give and to no other.
    Its momentum is that of its own condition 1 + row_sum·k·give.
    """
    opening, present_contact, own = opening_term(f), present_contact_term(f), own_term(f)
    write_load = contact_store_terms(f)[2]

    @wp.func
    def relax_body(
        model: ModelData, readout: ReadoutData, grid: GridData, before: PushData, after: PushData,
        sweep: int, world: int, a: int,
    ):  # fmt: skip
        """New loads λ [pN] of one body's contacts, and the push [µm, rad] from which the next sweep starts."""
        row = world * model.bodies + a
        count = grid.count[world, a]
        last = sweep == grid.moving.shape[1] - 1
        scale = float(1.0)
        if sweep == 0 and count > 0:
            scale = guess_scale(grid, world)
        linear = wp.vec3(0.0)
        angular = wp.vec3(0.0)
        force = wp.vec3(0.0)
        total = float(0.0)
        for i in range(count):
            c = present_contact(grid, before, world, row, i, a, sweep)
            start = scale * grid.ahead[row, i]
            row_sum = larger_row_sum(grid, world, c)
            opened = opening(grid, before, world, c, scale)
            reach = swept_reach(c, opened, start, row_sum)
            end = end_overlap(c, opened, start, row_sum, reach)
            load = c.floor + c.hardness * end * wp.sqrt(end)
            if wp.abs(load - start) * c.give > wp.static(SETTLED) + path_tolerance(c, reach):
                grid.moving[world, sweep] = 1
                if wp.static(not f.by_world):
                    grid.active[sweep] = 1
            ahead = load
            if last:
                # a free move without bound is the fault that `commit` reports
                if gap_error(c, start, c.overlap - opened) > UNSETTLED * c.radius and finite(grid.linear[world, a]):
                    raise_fault(readout, world, a, wp.static(int(Fault.UNSETTLED)), grid.clock[own(world)])
            else:
                ahead += momentum_of(c, row_sum * c.give, end, start, load, sweep)
            write_load(grid, row, i, load)
            grid.ahead[row, i] = ahead
            linear += ahead * c.response_a.linear
            angular += ahead * c.response_a.angular
            force += load * c.normal
            total += wp.abs(load)
        after.linear[world, a] = linear
        if wp.static(f.rigid):
            after.angular[world, a] = angular
        readout.contact_force[world, a] = force
        readout.contact_load[world, a] = total

    return relax_body


def make_relax(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its bodies): one of two sweeps, and the contact readout.

    Both partners compute the same λ from the same numbers, so the third law holds to rounding. A lone contact is
    solved by the first sweep.
    """
    relax_body = relax_body_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def relax(
        model: ModelData, readout: ReadoutData, grid: GridData, before: PushData, after: PushData,
        second: int, size: int,
    ):  # fmt: skip
        """One sweep over the contacts of the `size` bodies of one share of a world that is not at rest."""
        world, share = wp.tid()
        sweep = grid.sweep[0] + second
        if at_rest(grid, world, sweep):
            return
        for a in range(share * size, wp.min((share + 1) * size, model.bodies)):
            if grid.count[world, a] > 0:
                relax_body(model, readout, grid, before, after, sweep, world, a)

    return relax


@wp.kernel(enable_backward=False)
def next_sweeps(grid: GridData):
    """Go on to the next two sweeps if any world still moves; else mark the contacts as settled."""
    sweep = grid.sweep[0]
    grid.sweep[0] = sweep + 2
    grid.unsettled[0] = 0
    if sweep + 2 < grid.active.shape[0]:
        if grid.active[sweep] + grid.active[sweep + 1] > 0:
            grid.unsettled[0] = 1


@wp.kernel(enable_backward=False)
def resume_sweeps(grid: GridData):
    """Kernel over worlds: sweep on from the present forces, after the free displacements have changed."""
    world = wp.tid()
    resume(grid, world)
    reset_sweeps(grid, world)
    if world == 0:
        call_sweeps(grid, 1)
