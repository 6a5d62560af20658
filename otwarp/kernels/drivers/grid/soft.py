"""The step of lone spheres whose contacts are soft against the time step: one kernel, contact forces explicit.

A contact of stiffness k relaxes within a step by h = k·give (`give` is how far it opens per unit force). Where h stays
small for the stiffest contact that a run may have, the force at the start of the step serves for all of it, and no
sweep is needed: Δx = μ·(F + ΣF_contact)·dt + noise, the Euler–Maruyama step of the traps, with its error of h/2 in the
contact's relaxation; the implicit step of `contacts` errs by as much to the other side. Bodies sit in slots that
follow the cells, so that what is near in space is near in memory, and places are double-buffered: every thread reads
the places at the start of the step, and writes its own at the end.
"""

import warp as wp

from otwarp.kernels.bodies.bead import bead_constants_term
from otwarp.kernels.core.faults import FARTHEST, Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity
from otwarp.kernels.core.packed import beside, point_of, radius_of
from otwarp.kernels.core.periodic import kept_in_cell, nearest
from otwarp.kernels.core.recycling import has_left
from otwarp.kernels.core.step_constants import BeadConstants
from otwarp.kernels.core.types import ControlData, ModelData, Pose, ReadoutData, StateData
from otwarp.kernels.cpu.move_block import MOVES, move_block_term
from otwarp.kernels.cpu.noise_block import address_of
from otwarp.kernels.drivers.grid.data import GridData
from otwarp.kernels.drivers.grid.move import BLOCK, bead_move_term, draw_block_term
from otwarp.kernels.drivers.grid.neighbours import FULL, NEIGHBOURS, check_moved, next_in_cells_term
from otwarp.kernels.drivers.grid.pushes import QUANTA, listed_once_term, push_pairs_term
from otwarp.kernels.drivers.grid.soft_forces import SoftForce, soft_pair_term, soft_walls_term
from otwarp.kernels.forces.table import FORCES, active_forces
from otwarp.kernels.hydrodynamics.walls import out_of_walls
from otwarp.kernels.integrate.integrators import INTEGRATORS
from otwarp.kernels.optics.escapes import escape_term

AT_ONCE = 128
"""Spheres that a CPU takes through each part of a step before the next: what they need stays near the processor."""


def soft_contacts_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, i, a, here, step) -> SoftForce` on the sphere in slot i, body a."""
    walls = soft_walls_term(f) if f.obstacles else None
    pairs = (listed_once_term(f) if f.lanes else listed_twice_term(f)) if f.pairs else None

    @wp.func
    def soft_contacts(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, i: int, a: int,
        here: wp.vec4, step: wp.int64,
    ) -> SoftForce:  # fmt: skip
        """Sum of force and load [pN] over the neighbours, then over obstacles."""
        total = SoftForce()
        if wp.static(f.pairs):
            total = pairs(model, state, readout, grid, world, i, a, here, step)
        if wp.static(bool(f.obstacles)):
            if grid.near.walled[i] != 0:
                one = walls(model, readout, grid, world, a, here, step)
                total.force += one.force
                total.load += one.load
        return total

    return soft_contacts


def listed_twice_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, i, a, here, step) -> SoftForce` of the neighbours in its list."""
    soft_pair, next_in_cells = soft_pair_term(f), next_in_cells_term(f)

    @wp.func
    def listed_twice(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, i: int, a: int,
        here: wp.vec4, step: wp.int64,
    ) -> SoftForce:  # fmt: skip
        """Sum of force and load [pN] in the order of their bodies, so that it does not depend on that of slots."""
        n = grid.near
        total = SoftForce()
        count = n.count[i]
        for k in range(count):
            one = soft_pair(model, readout, grid, world, a, here, n.neighbour[i * n.stride + k * n.pitch], step)
            total.force += one.force
            total.load += one.load
        if count == FULL:
            j = next_in_cells(model, state, grid, world, i, -1)
            while j >= 0:
                one = soft_pair(model, readout, grid, world, a, here, j, step)
                total.force += one.force
                total.load += one.load
                j = next_in_cells(model, state, grid, world, i, j)
        return total

    return listed_twice


def step_slot_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, grid, world, i, bead, block, k)`: one step of the sphere in slot i."""
    bead_move = bead_move_term(f)
    contacts = soft_contacts_term(f)
    record_escapes = escape_term(f) if f.escapes else None

    @wp.func
    def step_slot(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData,
        world: int, i: int, bead: BeadConstants, block: wp.uint64, k: int,
    ):  # fmt: skip
        """Move the sphere in slot i by its free move and contact forces, unless the body has a fault."""
        row = grid.row[0]
        here = grid.place[row, i]
        b = grid.order[grid.turn[0], i]
        step = grid.clock[0]
        pose = Pose(point_of(here), wp.quat_identity())
        move, _drift = bead_move(model, control, state, grid, bead, world, b, pose.position, block, k)
        touch = contacts(model, state, readout, grid, world, i, b, here, step)
        scale = step_over_viscosity(model, world)
        moved = pose.position + move + (scale * model.body.translation[model.body.shape[b]]) * touch.force
        if not finite(moved):
            raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
        if wp.static(f.walls > 0):
            moved = moved + out_of_walls(model.walls, b, Pose(moved, pose.rotation))
        # faults are rare: one word that all threads share is read first
        if readout.fault_count[0] != 0:
            if readout.fault[world, b] != 0:
                moved = pose.position
        away = moved - grid.near.reference[i]
        arrived = Pose(moved, pose.rotation)
        if wp.static(f.periodic):
            away = nearest(model.period, away)
            moved = kept_in_cell(model, state, world, b, moved)
        if wp.static(f.inlet):
            grid.slot[world, b] = i
            if has_left(model, b, moved):
                grid.outside[0] = 1
        grid.place[1 - row, i] = beside(moved, radius_of(here))
        check_moved(grid.near, 0, away)
        if wp.static(f.escapes):
            time = wp.float64(step + wp.int64(1)) * model.time_step
            record_escapes(model, control, state, readout, world, b, pose, arrived, step + wp.int64(1), time)
        if step + wp.int64(1) == grid.until[0]:
            readout.contact_force[world, b] = touch.force
            readout.contact_load[world, b] = touch.load

    return step_slot


def make_soft_step(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its slots): one step of one sphere, from the present places to the next."""
    return make_soft_blocks(f) if f.lanes else make_soft_slots(f)


def make_soft_slots(f: Features) -> wp.Kernel:
    """The same, one sphere after the other."""
    bead_constants = bead_constants_term(f)
    step_slot = step_slot_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def soft_step(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, size: int
    ):
        """One step of the spheres in the `size` slots of one share of a world."""
        world, share = wp.tid()
        first = world * model.bodies
        for i in range(first + share * size, first + wp.min((share + 1) * size, model.bodies)):
            bead = bead_constants(model, control, world, grid.order[grid.turn[0], i])
            step_slot(model, control, state, readout, grid, world, i, bead, wp.uint64(0), 0)

    return soft_step


def step_alike_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, grid, world, i, last, block, k) -> int`: one step of some slots.

    From slot i on, up to `last` − 1, as far as the constants of the first serve; returns the next slot. Spheres of one
    shape that no trap acts on have all but their weight in common.
    """
    bead_constants = bead_constants_term(f)
    step_slot = step_slot_term(f)

    @wp.func
    def step_alike(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, world: int,
        first: int, last: int, block: wp.uint64, k: int,
    ) -> int:  # fmt: skip
        """Move the spheres of like constants in the slots from `first` on."""
        i = int(first)
        b = grid.order[grid.turn[0], first]
        shape = model.body.shape[b]
        bead = bead_constants(model, control, world, b)
        alike = bool(True)
        while alike:
            if wp.static(f.gravity):
                bead.weight = model.body.weight[b]
            at = k + i - first
            noise = block + wp.uint64(4 * 3 * (at - at % BLOCK))
            step_slot(model, control, state, readout, grid, world, i, bead, noise, at % BLOCK)
            i += 1
            alike = wp.static(not f.trap_models) and i < last
            if alike:
                b = grid.order[grid.turn[0], i]
                alike = model.body.shape[b] == shape
        return i

    return step_alike


def moves_in_blocks(f: Features) -> bool:
    """Whether noise, weight and contacts are all that may act on a sphere: then 16 move at once."""
    known = {FORCES["gravity"]} if f.gravity else set()
    plain = (
        set(active_forces(f)) == known and f.flow is None and not f.walls and INTEGRATORS[f.integrator].noise_ahead == 0
    )
    return plain and f.pairs and f.brownian and not (f.periodic or f.inlet or f.escapes or f.moving_obstacles)


def move_some_term(f: Features) -> wp.Function:
    """`(model, control, readout, grid, world, i, deviates, at) -> int`: move 16 slots from i on, if that is so."""
    bead_constants = bead_constants_term(f)
    move_block = move_block_term(f.gravity, bool(f.obstacles))

    @wp.func
    def move_some(
        model: ModelData, control: ControlData, readout: ReadoutData, grid: GridData, world: int, i: int,
        deviates: wp.array(dtype=wp.float32), at: int,
    ) -> int:  # fmt: skip
        """How many have moved: 16, or none where a fault or an obstacle is near, or a result is asked for."""
        if readout.fault_count[0] != 0 or grid.clock[0] + wp.int64(1) == grid.until[0]:
            return 0
        bead = bead_constants(model, control, world, grid.order[grid.turn[0], i])
        done = move_block(
            grid.place, grid.row[0], grid.order, grid.turn[0], i, model.body.shape, model.body.translation.shape[0],
            model.body.weight, grid.near.walled, bead.spread, bead.mobility_dt, QUANTA, FARTHEST, deviates, at,
            grid.push, grid.near.reference, grid.near.skin,
        )  # fmt: skip
        if done == 2:
            grid.near.stale[0] = 1
        return wp.where(done > 0, MOVES, 0)

    return move_some


def make_soft_blocks(f: Features) -> wp.Kernel:
    """The same on a CPU, `AT_ONCE` spheres at a time: what touches them, their noise, their moves."""
    draw_block = draw_block_term(f)
    push_pairs = push_pairs_term(f) if f.pairs else None
    move_some = move_some_term(f) if moves_in_blocks(f) else None
    step_alike = step_alike_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def soft_step(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, size: int
    ):
        """One step of the spheres in the `size` slots of one share of a world, of which there is one."""
        world, _share = wp.tid()
        deviates = wp.zeros(shape=(wp.static(3 * AT_ONCE),), dtype=wp.float32)
        chosen = wp.zeros(shape=(wp.static(2 * AT_ONCE * NEIGHBOURS + 2),), dtype=wp.int32)
        first = world * model.bodies
        end = first + size
        for i0 in range(first, end, AT_ONCE):
            count = wp.min(AT_ONCE, end - i0)
            if wp.static(f.pairs):
                # pairs push later slots alone, so that these have then been pushed by all
                push_pairs(model, state, readout, grid, world, i0, count, chosen)
            for k0 in range(0, count, BLOCK):
                draw_block(model, grid, deviates, 3 * k0, world, i0 + k0, wp.min(BLOCK, count - k0))
            i = int(i0)
            while i < i0 + count:
                last = i0 + count
                if wp.static(moves_in_blocks(f)):
                    last = wp.min(i + MOVES, last)
                    if last - i == MOVES:
                        i += move_some(model, control, readout, grid, world, i, deviates, 3 * (i - i0))
                while i < last:
                    noise = address_of(deviates, 0)
                    i = step_alike(model, control, state, readout, grid, world, i, last, noise, i - i0)

    return soft_step


@wp.kernel(enable_backward=False)
def fill_slots(model: ModelData, grid: GridData, size: int):
    """Put body i of a world into slot i, the order before any sort."""
    world, share = wp.tid()
    for b in range(share * size, wp.min((share + 1) * size, model.bodies)):
        grid.order[grid.turn[0], world * model.bodies + b] = b


@wp.kernel(enable_backward=False)
def load_slots(model: ModelData, state: StateData, grid: GridData, size: int):
    """Write present places [µm] and contact radii [µm] from the state; radius 0 for what does not collide."""
    world, share = wp.tid()
    row, turn = grid.row[0], grid.turn[0]
    for s in range(share * size, wp.min((share + 1) * size, model.bodies)):
        i = world * model.bodies + s
        b = grid.order[turn, i]
        p = state.position[world, b]
        radius = float(0.0)
        first = model.contact.start[b]
        if first < model.contact.start[b + 1]:
            radius = radius_of(model.contact.sphere[first])
        grid.place[row, i] = wp.vec4(p[0], p[1], p[2], radius)


@wp.kernel(enable_backward=False)
def store_slots(model: ModelData, state: StateData, grid: GridData, size: int):
    """Write the positions [µm] of the state from the present places."""
    world, share = wp.tid()
    row, turn = grid.row[0], grid.turn[0]
    for s in range(share * size, wp.min((share + 1) * size, model.bodies)):
        i = world * model.bodies + s
        p = grid.place[row, i]
        state.position[world, grid.order[turn, i]] = wp.vec3(p[0], p[1], p[2])
