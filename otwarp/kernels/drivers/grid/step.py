"""The grid driver: one thread per body and step, neighbours from lists, for scenes with many touching bodies.

Kernels go over (world, share): a share of `size` bodies is one body on a GPU, and all of them on a CPU, where Warp
copies the arguments of a kernel anew for every thread, which costs more than a body.

A step of bodies whose contacts are stiff is: `advance` (free displacements), `find` (each body lists its contacts),
`weigh` and sweeps of `relax` (contact forces from the displacements of both partners), `correct` (the integrator's
second stage, and the sweeps go on) and `commit`; see `contacts` for the contacts. Where contacts are soft it is
one kernel, see `soft`. New neighbour lists are made, and the sweeps taken, only when the device asks for it: these
parts of the captured graph are conditional. All steps and worlds use the same launches; the step counter lives in
device memory.
"""

from dataclasses import dataclass

import warp as wp

from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import point_of
from otwarp.kernels.core.periodic import kept_in_cell, nearest
from otwarp.kernels.core.recycling import has_left
from otwarp.kernels.core.rotation import rotate_by
from otwarp.kernels.core.types import ControlData, ModelData, Pose, ReadoutData, StateData
from otwarp.kernels.cpu.noise_block import address_of
from otwarp.kernels.drivers.grid.cells import make_bin
from otwarp.kernels.drivers.grid.contacts import make_relax, make_weigh
from otwarp.kernels.drivers.grid.data import GridData, PushData, body_pose_term, lifts_noise, own_term
from otwarp.kernels.drivers.grid.inlets import make_let_in
from otwarp.kernels.drivers.grid.lists import make_find
from otwarp.kernels.drivers.grid.move import BLOCK, draw_block_term, grid_move_term, make_correct, two_stages
from otwarp.kernels.drivers.grid.neighbours import check_moved, make_check, make_list
from otwarp.kernels.drivers.grid.slot_lists import make_slot_list, sort_by_cell
from otwarp.kernels.drivers.grid.soft import make_soft_step
from otwarp.kernels.drivers.grid.turns import make_settle
from otwarp.kernels.hydrodynamics.walls import out_of_walls
from otwarp.kernels.optics.escapes import escape_term
from otwarp.kernels.optics.trap_command import move_trap_term


@dataclass(frozen=True, kw_only=True)
class GridKernels:
    """Kernels of the grid driver; those that a scene does not need are None.

    Attributes:
        move_traps: Foci within their speed limits.
        bin, list, check: Neighbour lists: cells (`sort_by_cell` sorts as well), lists, and whether a state set from
            outside asks for new ones.
        soft: The whole step of lone spheres with soft contacts; then the following are None.
        advance, find, correct, commit: The step of all others, and their contact forces by sweeps, `weigh` and `relax`,
            or on a CPU in turn, `settle`.
        let_in: Cells that have left come in again.
    """

    move_traps: wp.Kernel | None
    bin: wp.Kernel | None
    list: wp.Kernel | None
    check: wp.Kernel | None
    soft: wp.Kernel | None
    advance: wp.Kernel | None
    find: wp.Kernel | None
    weigh: wp.Kernel | None
    relax: wp.Kernel | None
    settle: wp.Kernel | None
    correct: wp.Kernel | None
    commit: wp.Kernel | None
    let_in: wp.Kernel | None

    @property
    def all(self) -> list[wp.Kernel]:
        """Those that there are, in launch order."""
        return [kernel for kernel in vars(self).values() if kernel is not None]


def make_grid_step(f: Features) -> GridKernels:
    """The kernels that a feature set needs."""
    swept = f.contacts and not f.soft_contacts
    blocks = f.soft_contacts and f.lanes
    return GridKernels(
        move_traps=make_move_traps(f) if f.speed_limits else None,
        bin=None if not f.pairs else sort_by_cell if blocks else make_bin(f),
        list=None if not f.contacts else make_slot_list(f) if blocks else make_list(f),
        check=make_check(f) if f.contacts else None,
        soft=make_soft_step(f) if f.soft_contacts else None,
        advance=None if f.soft_contacts else make_advance(f),
        find=make_find(f) if swept else None,
        weigh=make_weigh(f) if swept and not f.in_turn else None,
        relax=make_relax(f) if swept and not f.in_turn else None,
        settle=make_settle(f) if swept and f.in_turn else None,
        correct=make_correct(f) if two_stages(f) else None,
        commit=None if f.soft_contacts else make_commit(f),
        let_in=make_let_in(f) if f.inlet else None,
    )


def advance_term(f: Features) -> wp.Function:
    """`(model, control, state, grid, world, begin, end, stride)`: free displacements of some bodies in this step.

    On a CPU, where noise comes in blocks, these are all from `begin` to `end` − 1: the stride is 1.
    """
    grid_move = grid_move_term(f)
    blocks = f.lanes or f.blocks
    draw_block = draw_block_term(f) if blocks else None
    body_pose = body_pose_term(f)

    @wp.func
    def advance_body(
        model: ModelData, control: ControlData, state: StateData, grid: GridData, world: int, b: int, block: wp.uint64,
        k: int,
    ):  # fmt: skip
        """Write the free move [µm, rad] of body b, and its drift for two stages; noise from place k of a block."""
        move, drift = grid_move(model, control, state, grid, world, b, body_pose(state, world, b), block, k)
        grid.linear[world, b] = move.linear
        if wp.static(f.rigid):
            grid.angular[world, b] = move.angular
        if wp.static(two_stages(f) or lifts_noise(f)):
            grid.drift[world, b] = drift.linear
            if wp.static(f.rigid):
                grid.turning[world, b] = drift.angular

    @wp.func
    def advance_some(
        model: ModelData, control: ControlData, state: StateData, grid: GridData, world: int, begin: int, end: int,
        stride: int,
    ):  # fmt: skip
        """Free moves of the bodies begin, begin + stride, …, below `end`."""
        if wp.static(blocks):
            deviates = wp.zeros(shape=(wp.static(3 * BLOCK),), dtype=wp.float32)
            for b0 in range(begin, end, wp.static(BLOCK)):
                count = wp.min(wp.static(BLOCK), end - b0)
                draw_block(model, grid, deviates, 0, world, world * model.bodies + b0, count)
                for k in range(count):
                    advance_body(model, control, state, grid, world, b0 + k, address_of(deviates, 0), k)
        else:
            for b in range(begin, end, stride):
                advance_body(model, control, state, grid, world, b, wp.uint64(0), 0)

    return advance_some


def make_advance(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its bodies): free displacement of this step."""
    advance_some = advance_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def advance(model: ModelData, control: ControlData, state: StateData, grid: GridData, size: int):
        """Free moves of the `size` bodies of one share of a world."""
        world, share = wp.tid()
        end = wp.min((share + 1) * size, model.bodies)
        advance_some(model, control, state, grid, world, share * size, end, 1)

    return advance


def check_body_term(f: Features) -> wp.Function:
    """`(model, grid, world, b, pose)`: ask for new neighbour lists if an element of a body has gone too far."""
    own = own_term(f)

    @wp.func
    def check_body(model: ModelData, grid: GridData, world: int, b: int, pose: Pose):
        """Compare the place of each colliding element of body b with that for which the lists were made [µm]."""
        turns = bool(True)
        if wp.static(f.rigid):
            turns = model.body.rigid[b] != 0
        for e in range(model.contact.start[b], model.contact.start[b + 1]):
            centre = pose.position
            if wp.static(f.rigid):
                if turns:
                    s = model.contact.sphere[e]
                    centre = centre + wp.quat_rotate(pose.rotation, point_of(s))
            away = centre - grid.near.reference[world * grid.near.elements + e]
            if wp.static(f.periodic):
                away = nearest(model.period, away)
            check_moved(grid.near, own(world), away)

    return check_body


def commit_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, grid, push, world, b)`: move a body without a fault; check how far it went."""
    record_escapes = escape_term(f) if f.escapes else None
    check_body = check_body_term(f) if f.contacts else None
    body_pose, own = body_pose_term(f), own_term(f)

    @wp.func
    def commit_body(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData,
        world: int, b: int,
    ):  # fmt: skip
        """Write the new pose of body b from its free move and push, unless it has a fault; record escapes."""
        step = grid.clock[own(world)]
        pose = body_pose(state, world, b)
        linear = grid.linear[world, b]
        angular = wp.vec3(0.0)
        if wp.static(f.rigid):
            angular = grid.angular[world, b]
        if wp.static(f.contacts):
            if wp.static(f.in_turn) or grid.count[world, b] > 0:
                linear += push.linear[world, b]
                if wp.static(f.rigid):
                    angular += push.angular[world, b]
        if not finite(pose.position + linear + angular):
            raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
        before = pose
        good = bool(True)
        # faults are rare: one word that all threads share is read first
        if readout.fault_count[0] != 0:
            good = readout.fault[world, b] == 0
        if good:
            pose.position = pose.position + linear
            if wp.static(f.rigid):
                if model.body.rigid[b] != 0:
                    pose.rotation = rotate_by(pose.rotation, angular)
                    state.orientation[world, b] = pose.rotation
            if wp.static(f.walls > 0):
                pose.position = pose.position + out_of_walls(model.walls, b, pose)
            state.position[world, b] = pose.position
            if wp.static(f.periodic):
                state.position[world, b] = kept_in_cell(model, state, world, b, pose.position)
            if wp.static(f.inlet):
                if has_left(model, b, state.position[world, b]):
                    grid.outside[own(world)] = 1
        if wp.static(f.escapes):
            time = wp.float64(step + wp.int64(1)) * model.time_step
            record_escapes(model, control, state, readout, world, b, before, pose, step + wp.int64(1), time)
        if wp.static(f.contacts):
            check_body(model, grid, world, b, pose)

    return commit_body


def make_commit(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its bodies): move what has no fault, and check how far it has gone."""
    commit_body = commit_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def commit(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, grid: GridData, push: PushData,
        size: int,
    ):  # fmt: skip
        """New poses of the `size` bodies of one share of a world."""
        world, share = wp.tid()
        for b in range(share * size, wp.min((share + 1) * size, model.bodies)):
            commit_body(model, control, state, readout, grid, push, world, b)

    return commit


def make_move_traps(f: Features) -> wp.Kernel:
    """Kernel over (world, trap): move the foci towards their commands within their speed limits."""
    move_trap = move_trap_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def move_traps(model: ModelData, control: ControlData, state: StateData, grid: GridData):
        """Move one focus one step on, no faster than its speed limit [µm/s]."""
        world, trap = wp.tid()
        move_trap(model, control, state, world, trap, wp.float64(grid.clock[0]) * model.time_step)

    return move_traps


@wp.kernel(enable_backward=False)
def start_clock(grid: GridData, first: wp.int64, steps: int, last: wp.int64):
    """Begin a launch of `steps` steps at step `first`, of a call that ends at step `last`."""
    grid.clock[0] = first
    grid.until[0] = last
    grid.left[0] = steps


@wp.kernel(enable_backward=False)
def tick(grid: GridData):
    """Count one step, and exchange present and next places."""
    grid.clock[0] = grid.clock[0] + wp.int64(1)
    grid.left[0] = grid.left[0] - 1
    grid.touching[0] = 0
    grid.outside[0] = 0
    grid.row[0] = 1 - grid.row[0]
