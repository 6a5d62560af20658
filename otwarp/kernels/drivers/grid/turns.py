"""Contact forces of the grid driver on a CPU: one contact after the other, until none moves.

A thread of a CPU has a world to itself, so that each contact can be solved exactly for its own force with all others as
they are by now, and both partners moved at once: coordinate descent (nonlinear Gauss–Seidel) on the convex energy of
`contacts`, whose every step lowers it, so that no stiffness makes it diverge (Tseng 2001,
doi:10.1023/A:1017501703105). Pairs stand in the list of their first body alone. The law of a contact, and the error at
which it counts as settled, are those of the sweeps.

Each body sums up how far the others have pushed it, back and forth, and each contact notes at which sum of its two
bodies it is due again: where they may have moved by more than its own tolerance, or have closed its gap, since it was
solved. What is at rest costs one comparison, and where none is due, none is out of its tolerance: the error of a gap,
nil when it was solved, grows by no more than its bodies move.
"""

import warp as wp

from otwarp.kernels.contact.contact import SETTLED, UNSETTLED, Contact, nearer_root
from otwarp.kernels.contact.excursion import path_tolerance, reach_beyond
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.roots import cube_root, length_of
from otwarp.kernels.core.types import ModelData, Move, ReadoutData
from otwarp.kernels.drivers.grid.contacts import gap_error, lift_term, opening_term
from otwarp.kernels.drivers.grid.data import GridData, PushData, own_term
from otwarp.kernels.drivers.grid.store import contact_store_terms, peek_terms

TURNS = 128
"""Most rounds over the contacts of a world."""


@wp.func
def kept_out(c: Contact, opened: float, reach: float) -> float:
    """What the load of a contact above its floor has to keep out [µm]; where it is below 0, how far off the gap is.

    The gap is open by `opened` [µm] with its present load; its path asks to keep out `reach` [µm], which is more than
    Hertz's law at the end does wherever its path counts.
    """
    return wp.max(reach, c.overlap - opened + c.give * (c.load - c.floor))


@wp.func
def load_alone(c: Contact, kept: float) -> float:
    """Load λ [pN] that solves a contact which has `kept` [µm] to keep out, all else at rest."""
    load = c.floor
    if kept > 0.0:
        # as `overlap_alone`; from within a third of the root four steps are as many as float32 has digits for
        a = c.give * c.hardness
        w = wp.min(wp.sqrt(kept), cube_root(kept / a))
        for _ in range(4):
            w = nearer_root(w, a, kept)
        load += c.hardness * w * w * w
    return load


@wp.func
def path_reach(c: Contact, opened: float) -> float:
    """What the path of a contact asks to keep out [µm], as `swept_reach`, with its present load."""
    reach = float(-1.0)
    if c.wander > 0.0:
        above = wp.max(c.load - c.floor, 0.0)
        root = float(0.0)
        if above > 0.0:
            root = cube_root(above / c.hardness)
        reach = reach_beyond(c, opened, above * c.give, root * root, 1.0)
    return reach


@wp.func
def leeway(c: Contact, kept: float, reach: float) -> float:
    """How far the bodies of a contact that is solved may move until it may be out of its tolerance [µm]."""
    return wp.static(SETTLED) + path_tolerance(c, reach) + wp.max(-kept, 0.0)


def move_pair_term(f: Features) -> wp.Function:
    """`(push, world, c, load)`: move both bodies of a contact by `load` [pN] more."""

    @wp.func
    def move_one(push: PushData, world: int, b: int, load: float, response: Move):
        """Add what `load` [pN] moves body b."""
        push.linear[world, b] = push.linear[world, b] + load * response.linear
        if wp.static(f.rigid):
            push.angular[world, b] = push.angular[world, b] + load * response.angular

    @wp.func
    def move_pair(push: PushData, world: int, c: Contact, load: float):
        """Add what `load` [pN] moves body a, and body b by the reaction."""
        move_one(push, world, c.a, load, c.response_a)
        if c.b >= 0:
            move_one(push, world, c.b, load, c.response_b)

    return move_pair


def way_terms(f: Features) -> tuple[wp.Function, wp.Function]:
    """Add to, and read, the sums of how far contact forces have moved bodies in this solution.

    `(model, grid, world, c, load)` adds what `load` [pN] more moves any point of both bodies of a contact at most;
    `(grid, world, a, b) -> wp.float64` is the sum [µm] of two bodies, or of one where b is -1. With the digits of
    float64 a move of `SETTLED` counts after any others.
    """

    @wp.func
    def add_one(model: ModelData, grid: GridData, world: int, b: int, load: float, response: Move):
        """Add how far `load` [pN] moves any point of body b at most."""
        far = length_of(response.linear)
        if wp.static(f.rigid):
            far += length_of(response.angular) * model.body.bound[b]
        grid.way[world, b] = grid.way[world, b] + wp.float64(wp.abs(load) * far)

    @wp.func
    def add_way(model: ModelData, grid: GridData, world: int, c: Contact, load: float):
        """Add what `load` [pN] more in a contact moves its bodies."""
        add_one(model, grid, world, c.a, load, c.response_a)
        if c.b >= 0:
            add_one(model, grid, world, c.b, load, c.response_b)

    @wp.func
    def way_of(grid: GridData, world: int, a: int, b: int) -> wp.float64:
        """How far bodies a and b have moved since the solution began [µm], together."""
        way = grid.way[world, a]
        if b >= 0:
            way += grid.way[world, b]
        return way

    return add_way, way_of


def one_round_term(f: Features) -> wp.Function:
    """`(model, grid, push, world, first) -> bool`: once every contact that is due; whether any has moved its bodies."""
    opening, move_pair = opening_term(f), move_pair_term(f)
    add_way, way_of = way_terms(f)
    partner_of = peek_terms(f)[0]
    _, read_contact, write_load, _ = contact_store_terms(f)

    @wp.func
    def take_turn(model: ModelData, grid: GridData, push: PushData, world: int, row: int, i: int, a: int) -> bool:
        """Solve entry i of body a, move both partners, and note when it is due again; whether they have moved."""
        c = read_contact(grid, row, i, a)
        opened = opening(grid, push, world, c, 1.0)
        reach = path_reach(c, opened)
        kept = kept_out(c, opened, reach)
        load = load_alone(c, kept)
        moves = load != c.load
        if moves:
            move_pair(push, world, c, load - c.load)
            add_way(model, grid, world, c, load - c.load)
            write_load(grid, row, i, load)
        grid.due[row, i] = way_of(grid, world, a, c.b) + wp.float64(leeway(c, kept, reach))
        return moves

    @wp.func
    def one_round(model: ModelData, grid: GridData, push: PushData, world: int, first: bool) -> bool:
        """A round over the contacts in the order of the bodies, in the first over all of them."""
        moves = bool(False)
        for a in range(model.bodies):
            row = world * model.bodies + a
            for i in range(grid.count[world, a]):
                if first or way_of(grid, world, a, partner_of(grid, row, i)) > grid.due[row, i]:
                    if take_turn(model, grid, push, world, row, i, a):
                        moves = True
        return moves

    return one_round


@wp.func
def add_to_report(readout: ReadoutData, world: int, c: Contact):
    """Add what a contact does to net force and load [pN] of its bodies."""
    force = c.load * c.normal
    readout.contact_force[world, c.a] = readout.contact_force[world, c.a] + force
    readout.contact_load[world, c.a] = readout.contact_load[world, c.a] + wp.abs(c.load)
    if c.b >= 0:
        readout.contact_force[world, c.b] = readout.contact_force[world, c.b] - force
        readout.contact_load[world, c.b] = readout.contact_load[world, c.b] + wp.abs(c.load)


def gather_term(f: Features) -> wp.Function:
    """`(model, readout, grid, push, world, report)`: pushes, and contact readout if wanted, from the loads, anew."""
    move_pair = move_pair_term(f)
    load_of = peek_terms(f)[1]
    _, read_contact, _, _ = contact_store_terms(f)

    @wp.func
    def gather(model: ModelData, readout: ReadoutData, grid: GridData, push: PushData, world: int, report: bool):
        """Sums without the rounding that many small changes leave; net force and sum of |forces| [pN] of each body."""
        for b in range(model.bodies):
            push.linear[world, b] = wp.vec3(0.0)
            if wp.static(f.rigid):
                push.angular[world, b] = wp.vec3(0.0)
            if report:
                readout.contact_force[world, b] = wp.vec3(0.0)
                readout.contact_load[world, b] = 0.0
        for a in range(model.bodies):
            row = world * model.bodies + a
            for i in range(grid.count[world, a]):
                if load_of(grid, row, i) != 0.0:
                    c = read_contact(grid, row, i, a)
                    move_pair(push, world, c, c.load)
                    if report:
                        add_to_report(readout, world, c)

    return gather


def check_rest_term(f: Features) -> wp.Function:
    """`(model, readout, grid, push, world)`: a fault where the rounds ended far from a solution."""
    opening, own = opening_term(f), own_term(f)
    _, read_contact, _, _ = contact_store_terms(f)

    @wp.func
    def check_rest(model: ModelData, readout: ReadoutData, grid: GridData, push: PushData, world: int):
        """Raise `UNSETTLED` for contacts that err by more than that part of their radius."""
        for a in range(model.bodies):
            row = world * model.bodies + a
            for i in range(grid.count[world, a]):
                c = read_contact(grid, row, i, a)
                overlap = c.overlap - opening(grid, push, world, c, 1.0)
                # a free move without bound is the fault that `commit` reports
                if gap_error(c, c.load, overlap) > UNSETTLED * c.radius and finite(grid.linear[world, a]):
                    raise_fault(readout, world, a, wp.static(int(Fault.UNSETTLED)), grid.clock[own(world)])

    return check_rest


def settle_term(f: Features) -> wp.Function:
    """`(model, readout, grid, push, world, again, turns)`: contact forces of a step of one world.

    From those at its start or, with `again` 1, from those of its first solution, after the free moves have changed.
    """
    one_round, gather, check_rest, own = one_round_term(f), gather_term(f), check_rest_term(f), own_term(f)
    lift = lift_term(f) if f.bends else None
    _, read_contact, _, write_lift = contact_store_terms(f)

    @wp.func
    def settle_world(
        model: ModelData, readout: ReadoutData, grid: GridData, push: PushData, world: int, again: int, turns: int
    ):
        """Solve the contacts of one world in `turns` rounds at most."""
        report = grid.clock[own(world)] + wp.int64(1) == grid.until[own(world)]
        if again == 0:
            gather(model, readout, grid, push, world, False)
        for b in range(model.bodies):
            grid.way[world, b] = wp.float64(0.0)
        if wp.static(f.bends):
            if again != 0:
                for a in range(model.bodies):
                    row = world * model.bodies + a
                    for i in range(grid.count[world, a]):
                        c = read_contact(grid, row, i, a)
                        write_lift(grid, row, i, lift(grid, push, world, c))
        busy = bool(True)
        turn = int(0)
        while busy and turn < turns:
            busy = one_round(model, grid, push, world, turn == 0)
            # without the rounding that large changes leave; those of a second solution are small
            if (turn == 0 and again == 0) or not busy:
                gather(model, readout, grid, push, world, report and not busy)
            turn += 1
        if busy:
            gather(model, readout, grid, push, world, report)
            check_rest(model, readout, grid, push, world)

    return settle_world


def make_settle(f: Features) -> wp.Kernel:
    """Kernel over worlds: their contact forces in this step."""
    settle_world = settle_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def settle(model: ModelData, readout: ReadoutData, grid: GridData, push: PushData, again: int, turns: int):
        """Solve the contacts of one world in `turns` rounds at most; `again` is 1 after the free moves have changed."""
        settle_world(model, readout, grid, push, wp.tid(), again, turns)

    return settle
