"""The `solo` driver: bodies that cannot touch, one thread per (world, body), state in registers for many steps."""

import warp as wp

from otwarp.kernels.bead import FEW_TRAPS, bead_constants_term
from otwarp.kernels.body import body_dynamics
from otwarp.kernels.escapes import NEAR, crossed, escape_term
from otwarp.kernels.faults import Fault, finite, raise_fault
from otwarp.kernels.features import Features
from otwarp.kernels.integrators import INTEGRATORS, whole_step
from otwarp.kernels.rigid import angular_part, linear_part
from otwarp.kernels.types import (
    BeadConstants,
    ControlData,
    ModelData,
    Pose,
    ReadoutData,
    StateData,
    TrapConstants,
    TrapData,
    world_row,
)
from otwarp.kernels.walls import out_of_walls, sphere_dynamics


def make_solo_step(f: Features) -> wp.Kernel:
    """Step for bodies that do not touch; lone spheres have a kernel of their own that keeps constants in registers."""
    return make_body_step(f) if f.rigid else make_bead_step(f)


@wp.struct
class Watch:
    """One trap's view of a lone sphere, kept in registers over a launch."""

    reach: wp.float32  # distance at which the sphere has escaped [µm], inf if the trap does not hold it or lost it
    near2: wp.float32  # squared distance beyond which it may have left and come back within a step [µm²]
    last2: wp.float32  # squared distance one step ago [µm²]
    escape: wp.int32  # steps of this launch after which it was lost, -1: never


@wp.func
def start_watch(traps: TrapData, readout: ReadoutData, bead: BeadConstants, world: int, b: int, trap: int) -> Watch:
    """Watch the sphere that a trap holds, unless it is another one or has escaped before."""
    watch = Watch()
    watch.reach = traps.held_range[world_row(traps.held_range.shape[0], world), trap]
    if traps.held_body[trap] != b or readout.escape_step[world, trap] >= wp.int64(0) or bead.trapped == 0:
        watch.reach = wp.inf
    near = wp.max(watch.reach - NEAR * bead.spread, 0.0)
    watch.near2 = near * near
    watch.escape = -1
    return watch


def watch_term(f: Features) -> wp.Function:
    """`(model, bead, watch, law, command, world, trap, position, first, taken) -> Watch` after `taken` steps."""

    @wp.func
    def watched(
        model: ModelData,
        bead: BeadConstants,
        watch: Watch,
        law: TrapConstants,
        command: wp.vec4,
        world: int,
        trap: int,
        position: wp.vec3,
        first: wp.int64,
        taken: int,
    ) -> Watch:
        """Lost if out of reach of a trap that shines, now or since the last look."""
        # the same displacement as the force of the step needs, so that it is computed once
        away2 = wp.length_sq(position - (wp.vec3(command[0], command[1], command[2]) + law.equilibrium * law.axis))
        if wp.max(away2, watch.last2) > watch.near2 and command[3] > 0.0:
            lost = away2 > watch.reach * watch.reach
            if wp.static(f.brownian and f.crossings):
                if taken > 0 and not lost:
                    step = first + wp.int64(taken - 1)
                    s2 = bead.spread * bead.spread
                    lost = crossed(model.seed, world, trap, step, watch.reach, watch.last2, away2, s2)
            if lost:
                watch.escape = taken
                watch.reach = wp.inf
                watch.near2 = wp.inf
        watch.last2 = away2
        return watch

    return watched


@wp.func
def note_escape(readout: ReadoutData, watch: Watch, world: int, trap: int, first: wp.int64):
    """Report a loss; a sphere that starts out of reach escapes with the first step."""
    if watch.escape >= 0:
        readout.escape_step[world, trap] = first + wp.int64(wp.max(watch.escape, 1))


@wp.struct
class Watches:
    """The views of `FEW_TRAPS` traps."""

    first: Watch
    second: Watch


def start_watches_term(f: Features) -> wp.Function:
    """`(traps, readout, bead, world, b) -> Watches` of the traps there are."""

    @wp.func
    def start_watches(traps: TrapData, readout: ReadoutData, bead: BeadConstants, world: int, b: int) -> Watches:
        """Each as `start_watch`."""
        watches = Watches()
        watches.first = start_watch(traps, readout, bead, world, b, 0)
        if wp.static(f.traps == FEW_TRAPS):
            watches.second = start_watch(traps, readout, bead, world, b, 1)
        return watches

    return start_watches


def look_term(f: Features) -> wp.Function:
    """`(model, bead, watches, world, position, first, taken) -> Watches` after `taken` steps of a launch."""
    watched = watch_term(f)

    @wp.func
    def look(
        model: ModelData, bead: BeadConstants, watches: Watches, world: int, position: wp.vec3, first: wp.int64,
        taken: int,
    ) -> Watches:  # fmt: skip
        """Each as `watched`."""
        out = watches
        out.first = watched(
            model, bead, watches.first, bead.first, bead.first_command, world, 0, position, first, taken
        )
        if wp.static(f.traps == FEW_TRAPS):
            out.second = watched(
                model, bead, watches.second, bead.second, bead.second_command, world, 1, position, first, taken
            )
        return out

    return look


def make_bead_step(f: Features) -> wp.Kernel:
    """Step for lone spheres: whatever does not change over a launch is read once."""
    bead_constants = bead_constants_term(f)
    move_freely = whole_step(INTEGRATORS[f.integrator], sphere_dynamics(f))
    watch = f.escapes and f.still_traps and f.traps <= FEW_TRAPS
    start_watches, look = start_watches_term(f), look_term(f)
    note_escapes = escape_term(f) if f.escapes and not watch else None

    # one thread per body: Warp's loop over more bodies than threads would cost registers and 5 % of the speed
    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=f.module_options)
    def bead_step(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        first_world: int,
        first_step: wp.int64,
        steps: int,
    ):
        """Take `steps` steps from `first_step` for the worlds from `first_world` on."""
        world = first_world + wp.tid()
        b = int(0)
        if wp.static(f.bodies > 1):
            b = wp.tid() % wp.static(f.bodies)
            world = first_world + wp.tid() // wp.static(f.bodies)
        position = state.position[world, b]
        bead = bead_constants(model, control, world, b)
        watches = Watches()
        if wp.static(watch):
            watches = start_watches(model.traps, readout, bead, world, b)
        taken = int(0)
        for i in range(steps):
            if wp.static(watch):
                watches = look(model, bead, watches, world, position, first_step, i)
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            moved = position + move_freely(model, control, state, bead, world, b, position, step, time)
            if wp.static(f.walls > 0):
                moved += out_of_walls(model.walls, b, Pose(moved, wp.quat_identity()))
            if not finite(moved):
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                break
            taken = i + 1
            if wp.static(f.escapes and not watch):
                before = Pose(position, wp.quat_identity())
                pose = Pose(moved, wp.quat_identity())
                note_escapes(
                    model, control, state, readout, world, b, before, pose, step + wp.int64(1), time + model.time_step
                )
            position = moved
        state.position[world, b] = position
        if wp.static(watch):
            watches = look(model, bead, watches, world, position, first_step, taken)
            note_escape(readout, watches.first, world, 0, first_step)
            if wp.static(f.traps == FEW_TRAPS):
                note_escape(readout, watches.second, world, 1, first_step)

    return bead_step


def make_body_step(f: Features) -> wp.Kernel:
    """Step for bodies of which some rotate."""
    constants_of, dynamics = body_dynamics(f)
    move_freely = whole_step(INTEGRATORS[f.integrator], dynamics)
    note_escapes = escape_term(f) if f.escapes else None

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=f.module_options)
    def body_step(
        model: ModelData,
        control: ControlData,
        state: StateData,
        readout: ReadoutData,
        first_world: int,
        first_step: wp.int64,
        steps: int,
    ):
        """Take `steps` steps from `first_step` for the worlds from `first_world` on."""
        world = first_world + wp.tid()
        b = int(0)
        if wp.static(f.bodies > 1):
            b = wp.tid() % wp.static(f.bodies)
            world = first_world + wp.tid() // wp.static(f.bodies)
        pose = Pose(state.position[world, b], state.orientation[world, b])
        body = constants_of(model, control, world, b)
        bound = model.body.bound[b]
        leeway = float(0.0)
        for i in range(steps):
            step = first_step + wp.int64(i)
            time = wp.float64(step) * model.time_step
            move = move_freely(model, control, state, body, world, b, pose, step, time)
            if not finite(pose.position + linear_part(move) + angular_part(move)):
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                break
            before = pose
            pose = moved_by(before, move)
            if wp.static(f.walls > 0):
                pose.position = pose.position + out_of_walls(model.walls, b, pose)
            if wp.static(f.escapes):
                # watched closely only where something can be lost
                leeway -= wp.length(pose.position - before.position) + bound * wp.length(angular_part(move))
                if leeway <= 0.0:
                    arrival = step + wp.int64(1)
                    later = time + model.time_step
                    leeway = note_escapes(model, control, state, readout, world, b, before, pose, arrival, later)
        state.position[world, b] = pose.position
        state.orientation[world, b] = pose.rotation

    moved_by = dynamics.shifted
    return body_step
