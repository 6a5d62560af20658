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
from otwarp.kernels.contact.contact import NO_CONTACT, pair_law
from otwarp.kernels.contact.curvature import relative_radius_term
from otwarp.kernels.contact.obstacles import distance_term, moving_pose, still_pose
from otwarp.kernels.core.faults import OVERLAP_LIMIT, Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity
from otwarp.kernels.core.packed import beside, distance_of, point_of, radius_of
from otwarp.kernels.core.periodic import kept_in_cell, nearest
from otwarp.kernels.core.recycling import has_left
from otwarp.kernels.core.types import BeadConstants, ControlData, ModelData, Pose, ReadoutData, StateData
from otwarp.kernels.cpu.noise_block import address_of
from otwarp.kernels.drivers.grid.data import GridData
from otwarp.kernels.drivers.grid.move import BLOCK, bead_move_term, draw_block_term
from otwarp.kernels.drivers.grid.neighbours import FULL, NEIGHBOURS, check_moved, next_in_cells_term
from otwarp.kernels.drivers.grid.slot_lists import touching_pairs_term
from otwarp.kernels.hydrodynamics.walls import out_of_walls
from otwarp.kernels.optics.escapes import escape_term

AT_ONCE = 128
"""Spheres that a CPU takes through each part of a step before the next: their sums stay near the processor."""


@wp.struct
class SoftForce:
    """Net contact force on a sphere [pN], and the sum of the normal forces."""

    force: wp.vec3
    load: float


def soft_pair_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, here, j, step) -> SoftForce` of the sphere in slot j on body a."""

    @wp.func
    def soft_pair(
        model: ModelData,
        readout: ReadoutData,
        grid: GridData,
        world: int,
        a: int,
        here: wp.vec4,
        j: int,
        step: wp.int64,
    ) -> SoftForce:
        """Force and load [pN] on body a, whose centre and radius [µm] are `here`."""
        out = SoftForce(wp.vec3(0.0), 0.0)
        there = grid.place[grid.row[0], j]
        way = wp.vec3(here[0] - there[0], here[1] - there[1], here[2] - there[2])
        if wp.static(f.periodic):
            way = nearest(model.period, way)
        both = radius_of(here) + radius_of(there)
        far = both + grid.near.reach
        square = wp.length_sq(way)
        if square < far * far:
            overlap = both - wp.sqrt(square)
            least = wp.min(radius_of(here), radius_of(there))
            if overlap > OVERLAP_LIMIT * least:
                raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
            b = grid.order[grid.turn[0], j]
            law = pair_law(model.contact, a, b, radius_of(here) * radius_of(there) / both, overlap)
            out.force = law.force * wp.normalize(way)
            out.load = wp.abs(law.force)
        return out

    return soft_pair


def soft_walls_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, a, here, step) -> SoftForce` of the obstacles."""
    pose_at = moving_pose if f.moving_obstacles else still_pose
    distance_to = distance_term(f.obstacles)
    relative_radius = relative_radius_term(f.obstacles)

    @wp.func
    def soft_walls(
        model: ModelData, readout: ReadoutData, grid: GridData, world: int, a: int, here: wp.vec4, step: wp.int64
    ) -> SoftForce:
        """Sum of force and load [pN] over the obstacles within reach."""
        out = SoftForce(wp.vec3(0.0), 0.0)
        time = wp.float64(step) * model.time_step
        far = radius_of(here) + grid.near.reach
        for o in range(model.obstacles.shape.shape[0]):
            wall = pose_at(model.obstacles, o, time)
            away = point_of(here) - wall.position
            if wp.static(f.periodic):
                away = nearest(model.period, away)
            if wp.length(away) < far + model.obstacles.bound[o]:
                local = wp.quat_rotate_inv(wall.rotation, away)
                hit = distance_to(model.obstacles, o, local, far)
                if distance_of(hit) < far:
                    overlap = radius_of(here) - distance_of(hit)
                    if overlap > OVERLAP_LIMIT * radius_of(here):
                        raise_fault(readout, world, a, wp.static(int(Fault.OVERLAP)), step)
                    outward = point_of(hit)
                    relative = relative_radius(model.obstacles, o, local, outward, radius_of(here))
                    law = pair_law(model.contact, a, NO_CONTACT, relative, overlap)
                    out.force += law.force * wp.quat_rotate(wall.rotation, outward)
                    out.load += wp.abs(law.force)
        return out

    return soft_walls


def soft_contacts_term(f: Features) -> wp.Function:
    """`(model, state, readout, grid, world, i, a, here, step, total) -> SoftForce` on the sphere in slot i, body a.

    `total` is what pairs exert that are not looked for here: on a CPU those of the list, see `listed_pairs_term`.
    """
    walls = soft_walls_term(f) if f.obstacles else None
    soft_pair = soft_pair_term(f) if f.pairs else None
    next_in_cells = next_in_cells_term(f) if f.pairs else None

    @wp.func
    def soft_contacts(
        model: ModelData, state: StateData, readout: ReadoutData, grid: GridData, world: int, i: int, a: int,
        here: wp.vec4, step: wp.int64, total: SoftForce,
    ) -> SoftForce:  # fmt: skip
        """Sum of force and load [pN] over the neighbours in the order of their bodies, then over obstacles."""
        n = grid.near
        if wp.static(f.pairs):
            count = n.count[i]
            if wp.static(not f.lanes):
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
        if wp.static(bool(f.obstacles)):
            if n.walled[i] != 0:
                one = walls(model, readout, grid, world, a, here, step)
                total.force += one.force
                total.load += one.load
        return total

    return soft_contacts


def step_slot_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, grid, world, i, bead, block, k, pairs)`: one step of the sphere in slot i."""
    bead_move = bead_move_term(f)
    contacts = soft_contacts_term(f)
    record_escapes = escape_term(f) if f.escapes else None

    @wp.func
    def step_slot(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData,
        world: int, i: int, bead: BeadConstants, block: wp.uint64, k: int, pairs: SoftForce,
    ):  # fmt: skip
        """Move the sphere in slot i by its free move and contact forces, unless the body has a fault."""
        row = grid.row[0]
        here = grid.place[row, i]
        b = grid.order[grid.turn[0], i]
        step = grid.clock[0]
        pose = Pose(point_of(here), wp.quat_identity())
        move, _drift = bead_move(model, control, state, grid, bead, world, b, pose.position, block, k)
        touch = contacts(model, state, readout, grid, world, i, b, here, step, pairs)
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
            step_slot(model, control, state, readout, grid, world, i, bead, wp.uint64(0), 0, SoftForce())

    return soft_step


def listed_pairs_term(f: Features) -> wp.Function:
    """`(model, readout, grid, world, first, count, chosen, sums)`: contact forces of the lists of `count` slots."""
    soft_pair = soft_pair_term(f)
    touching_pairs = touching_pairs_term(f)

    @wp.func
    def listed_pairs(
        model: ModelData, readout: ReadoutData, grid: GridData, world: int, first: int, count: int,
        chosen: wp.array(dtype=wp.int32), sums: wp.array(dtype=SoftForce),
    ):  # fmt: skip
        """Write the sums of force and load [pN] on the slots first … first + count − 1."""
        for k in range(count):
            sums[k] = SoftForce()
        step = grid.clock[0]
        for t in range(touching_pairs(model, grid, first, count, chosen)):
            i = chosen[2 * t]
            a = grid.order[grid.turn[0], i]
            one = soft_pair(model, readout, grid, world, a, grid.place[grid.row[0], i], chosen[2 * t + 1], step)
            sums[i - first].force += one.force
            sums[i - first].load += one.load

    return listed_pairs


def step_alike_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, grid, world, i, last, block, k, sums) -> int`: one step of some slots.

    From slot i on, up to `last` − 1, as far as the constants of the first serve; returns the next slot. Spheres of one
    shape that no trap acts on have all but their weight in common.
    """
    bead_constants = bead_constants_term(f)
    step_slot = step_slot_term(f)

    @wp.func
    def step_alike(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, world: int,
        first: int, last: int, block: wp.uint64, k: int, sums: wp.array(dtype=SoftForce),
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
            step_slot(model, control, state, readout, grid, world, i, bead, noise, at % BLOCK, sums[at])
            i += 1
            alike = wp.static(not f.trap_models) and i < last
            if alike:
                b = grid.order[grid.turn[0], i]
                alike = model.body.shape[b] == shape
        return i

    return step_alike


def make_soft_blocks(f: Features) -> wp.Kernel:
    """The same on a CPU, `AT_ONCE` spheres at a time: their noise, what touches them, their moves."""
    draw_block = draw_block_term(f)
    listed_pairs = listed_pairs_term(f) if f.pairs else None
    step_alike = step_alike_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def soft_step(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, size: int
    ):
        """One step of the spheres in the `size` slots of one share of a world."""
        world, share = wp.tid()
        deviates = wp.zeros(shape=(wp.static(3 * AT_ONCE),), dtype=wp.float32)
        chosen = wp.zeros(shape=(wp.static(2 * AT_ONCE * NEIGHBOURS + 2),), dtype=wp.int32)
        sums = wp.zeros(shape=(AT_ONCE,), dtype=SoftForce)
        first = world * model.bodies + share * size
        end = wp.min(first + size, (world + 1) * model.bodies)
        for i0 in range(first, end, AT_ONCE):
            count = wp.min(AT_ONCE, end - i0)
            for k0 in range(0, count, BLOCK):
                draw_block(model, grid, deviates, 3 * k0, world, i0 + k0, wp.min(BLOCK, count - k0))
            if wp.static(f.pairs):
                listed_pairs(model, readout, grid, world, i0, count, chosen, sums)
            i = int(i0)
            while i < i0 + count:
                noise = address_of(deviates, 0)
                i = step_alike(model, control, state, readout, grid, world, i, i0 + count, noise, i - i0, sums)

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
