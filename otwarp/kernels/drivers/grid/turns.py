"""Contact forces of the grid driver on a CPU: one contact after the other, until none moves.

A thread of a CPU has a world to itself, so that each contact can be solved exactly for its own force with all others as
they are by now, and both partners moved at once: coordinate descent (nonlinear Gauss–Seidel) on the convex energy of
`contacts`, whose every step lowers it, so that no stiffness makes it diverge (Tseng 2001,
doi:10.1023/A:1017501703105). A contact is looked at again only after a body of it has moved since, so that what is at
rest costs one comparison. Pairs stand in the list of their first body alone. The law of a contact, and the error at
which it counts as settled, are those of the sweeps.
"""

import warp as wp

from otwarp.kernels.contact.contact import SETTLED, UNSETTLED, Contact
from otwarp.kernels.contact.excursion import path_tolerance, swept_reach
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, Move, ReadoutData
from otwarp.kernels.drivers.grid.contacts import end_overlap, gap_error, lift_term, opening_term
from otwarp.kernels.drivers.grid.data import GridData, PushData, own_term
from otwarp.kernels.drivers.grid.store import contact_store_terms, peek_terms

TURNS = 128
"""Most rounds over the contacts of a world."""


@wp.func
def load_alone(c: Contact, opened: float) -> float:
    """Load λ [pN] that solves a contact whose gap is open by `opened` [µm] with its present load, all else at rest."""
    end = end_overlap(c, opened, c.load, 1.0, swept_reach(c, opened, c.load, 1.0))
    return c.floor + c.hardness * end * wp.sqrt(end)


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


def one_round_term(f: Features) -> wp.Function:
    """`(model, grid, push, world, turn) -> int`: once every contact that needs it; 1 if any was not settled."""
    opening, move_pair = opening_term(f), move_pair_term(f)
    partner_of = peek_terms(f)[0]
    _, read_contact, write_load, _ = contact_store_terms(f)

    @wp.func
    def take_turn(grid: GridData, push: PushData, world: int, row: int, i: int, a: int, b: int, turn: int) -> int:
        """Solve entry i of body a, and move both partners; 1 if it was not settled."""
        c = read_contact(grid, row, i, a)
        opened = opening(grid, push, world, c, 1.0)
        load = load_alone(c, opened)
        moved = int(0)
        if load != c.load:
            move_pair(push, world, c, load - c.load)
            write_load(grid, row, i, load)
            reach = swept_reach(c, opened, c.load, 1.0)
            if wp.abs(load - c.load) * c.give > wp.static(SETTLED) + path_tolerance(c, reach):
                grid.stir[world, a] = turn
                if b >= 0:
                    grid.stir[world, b] = turn
                moved = 1
        return moved

    @wp.func
    def one_round(model: ModelData, grid: GridData, push: PushData, world: int, turn: int) -> int:
        """A round over the contacts in the order of the bodies."""
        busy = int(0)
        for a in range(model.bodies):
            row = world * model.bodies + a
            for i in range(grid.count[world, a]):
                b = partner_of(grid, row, i)
                wanted = turn == 0 or grid.stir[world, a] >= turn - 1
                if b >= 0:
                    wanted = wanted or grid.stir[world, b] >= turn - 1
                if wanted:
                    busy = wp.max(busy, take_turn(grid, push, world, row, i, a, b, turn))
        return busy

    return one_round


def gather_term(f: Features) -> wp.Function:
    """`(model, readout, grid, push, world)`: pushes and contact readout from the loads, anew."""
    move_pair = move_pair_term(f)
    load_of = peek_terms(f)[1]
    _, read_contact, _, _ = contact_store_terms(f)

    @wp.func
    def gather(model: ModelData, readout: ReadoutData, grid: GridData, push: PushData, world: int):
        """Sums without the rounding that many small changes leave; net force and sum of |forces| [pN] of each body."""
        for b in range(model.bodies):
            push.linear[world, b] = wp.vec3(0.0)
            if wp.static(f.rigid):
                push.angular[world, b] = wp.vec3(0.0)
            readout.contact_force[world, b] = wp.vec3(0.0)
            readout.contact_load[world, b] = 0.0
        for a in range(model.bodies):
            row = world * model.bodies + a
            for i in range(grid.count[world, a]):
                if load_of(grid, row, i) != 0.0:
                    c = read_contact(grid, row, i, a)
                    move_pair(push, world, c, c.load)
                    force = c.load * c.normal
                    readout.contact_force[world, a] = readout.contact_force[world, a] + force
                    readout.contact_load[world, a] = readout.contact_load[world, a] + wp.abs(c.load)
                    if c.b >= 0:
                        readout.contact_force[world, c.b] = readout.contact_force[world, c.b] - force
                        readout.contact_load[world, c.b] = readout.contact_load[world, c.b] + wp.abs(c.load)

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
    one_round, gather, check_rest = one_round_term(f), gather_term(f), check_rest_term(f)
    lift = lift_term(f) if f.bends else None
    _, read_contact, _, write_lift = contact_store_terms(f)

    @wp.func
    def settle_world(
        model: ModelData, readout: ReadoutData, grid: GridData, push: PushData, world: int, again: int, turns: int
    ):
        """Solve the contacts of one world in `turns` rounds at most."""
        if again == 0:
            gather(model, readout, grid, push, world)
        if wp.static(f.bends):
            if again != 0:
                for a in range(model.bodies):
                    row = world * model.bodies + a
                    for i in range(grid.count[world, a]):
                        c = read_contact(grid, row, i, a)
                        write_lift(grid, row, i, lift(grid, push, world, c))
        busy = int(1)
        turn = int(0)
        while busy != 0 and turn < turns:
            busy = one_round(model, grid, push, world, turn)
            if turn == 0 or busy == 0:
                gather(model, readout, grid, push, world)
            turn += 1
        if busy != 0:
            gather(model, readout, grid, push, world)
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
