"""The `solo` driver: bodies that cannot touch, one thread per (world, body), state in registers for many steps."""

import warp as wp

from otwarp.kernels.bodies.bead import bead_constants_term
from otwarp.kernels.bodies.rigid import angular_part, linear_part
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import FEW_TRAPS, Features
from otwarp.kernels.core.step_constants import BeadConstants
from otwarp.kernels.core.types import ControlData, ModelData, Pose, ReadoutData, StateData, TrapData
from otwarp.kernels.core.worlds import living_world, own_step
from otwarp.kernels.drivers.inlets import kept_in_space_term
from otwarp.kernels.forces.traps import next_pieces_term, takes_pieces
from otwarp.kernels.hydrodynamics.walls import out_of_walls, sphere_dynamics
from otwarp.kernels.integrate.body import body_dynamics
from otwarp.kernels.integrate.integrators import INTEGRATORS, whole_step
from otwarp.kernels.optics import thread_rows
from otwarp.kernels.optics.escapes import (
    EscapeMonitor,
    escape_term,
    monitor_term,
    report_escape,
    start_monitor,
    way_term,
)
from otwarp.kernels.optics.near_traps import keep_aims_term, list_pairs_term
from otwarp.kernels.optics.thread_rows import any_beside
from otwarp.kernels.optics.trap_command import kept_anchor_term


def make_solo_step(f: Features) -> wp.Kernel:
    """Step for bodies that do not touch; lone spheres have a kernel of their own that keeps constants in registers."""
    return make_body_step(f) if f.rigid else make_bead_step(f)


@wp.struct
class EscapeMonitors:
    """The views of `FEW_TRAPS` traps."""

    first: EscapeMonitor
    second: EscapeMonitor


def start_monitors_term(f: Features) -> wp.Function:
    """`(traps, readout, bead, world, b) -> EscapeMonitors` of the traps there are."""

    @wp.func
    def start_monitors(
        traps: TrapData, readout: ReadoutData, bead: BeadConstants, world: int, b: int
    ) -> EscapeMonitors:
        """Escape monitors of the traps there are, at most two, at the start of a launch."""
        monitors = EscapeMonitors()
        monitors.first = start_monitor(traps, readout, bead, world, b, 0)
        if wp.static(f.traps == FEW_TRAPS):
            monitors.second = start_monitor(traps, readout, bead, world, b, 1)
        return monitors

    return start_monitors


def look_term(f: Features) -> wp.Function:
    """`(model, bead, monitors, world, position, first, taken) -> EscapeMonitors` after `taken` steps."""
    monitored, kept_anchor = monitor_term(f), kept_anchor_term(f)

    @wp.func
    def look(
        model: ModelData, bead: BeadConstants, monitors: EscapeMonitors, world: int, position: wp.vec3,
        first: wp.int64, taken: int,
    ) -> EscapeMonitors:  # fmt: skip
        """The monitors after `taken` steps with the sphere at `position` [µm]."""
        out = monitors
        time = wp.float64(first + wp.int64(taken)) * model.time_step
        anchor = kept_anchor(bead.first, bead.first_anchor, bead.first_glide, time)
        out.first = monitored(model, bead, monitors.first, anchor, world, 0, position, first, taken)
        if wp.static(f.traps == FEW_TRAPS):
            other = kept_anchor(bead.second, bead.second_anchor, bead.second_glide, time)
            out.second = monitored(model, bead, monitors.second, other, world, 1, position, first, taken)
        return out

    return look


def place_term(f: Features) -> wp.Function:
    """`(model, first_world, first_step, thread) -> (world, body, first step)`: what a thread owns; world -1: none."""

    @wp.func
    def place_of(
        model: ModelData, first_world: int, first_step: wp.int64, thread: int
    ) -> tuple[int, int, wp.int64]:  # fmt: skip
        """Indices of a thread's world and body, and the step [1] from which it takes that world on."""
        world = first_world + thread
        b = int(0)
        if wp.static(f.bodies > 1):
            b = thread % wp.static(f.bodies)
            world = first_world + thread // wp.static(f.bodies)
        start = first_step
        if wp.static(f.episodes):
            world = living_world(model, world)
            if world >= 0:
                start = own_step(model, world, first_step)
        return world, b, start

    return place_of


def make_bead_step(f: Features) -> wp.Kernel:
    """Step for lone spheres: whatever does not change over a launch is read once."""
    bead_constants = bead_constants_term(f)
    move_freely = whole_step(INTEGRATORS[f.integrator], sphere_dynamics(f))
    monitor = f.monitors > 0
    next_pieces = next_pieces_term(f)
    place_of, start_monitors, look = place_term(f), start_monitors_term(f), look_term(f)
    record_escapes = escape_term(f) if f.escapes and not monitor else None
    kept_in_space = kept_in_space_term(f)

    # one thread per body: Warp's loop over more bodies than threads would cost registers and 5 % of the speed
    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=f.module_options)
    def bead_step(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, first_world: int,
        first_step: wp.int64, steps: int,
    ):  # fmt: skip
        """Take `steps` steps from `first_step` for the worlds from `first_world` on, one sphere a thread."""
        world, b, start = place_of(model, first_world, first_step, wp.tid())
        if wp.static(f.episodes):
            if world < 0:
                return
        position = state.position[world, b]
        bead = bead_constants(model, control, world, b)
        monitors = EscapeMonitors()
        if wp.static(monitor):
            monitors = start_monitors(model.traps, readout, bead, world, b)
        taken = int(0)
        for i in range(steps):
            if wp.static(monitor):
                monitors = look(model, bead, monitors, world, position, start, i)
            step = start + wp.int64(i)
            time = wp.float64(step) * model.time_step
            if wp.static(takes_pieces(f)):
                bead = next_pieces(model, control, bead, time)
            moved = position + move_freely(model, control, state, bead, world, b, position, step, time)
            if wp.static(f.walls > 0):
                moved += out_of_walls(model.walls, b, Pose(moved, wp.quat_identity()))
            if not finite(moved):
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                break
            taken = i + 1
            if wp.static(f.escapes and not monitor):
                before = Pose(position, wp.quat_identity())
                pose = Pose(moved, wp.quat_identity())
                record_escapes(
                    model, control, state, readout, world, b, before, pose, step + wp.int64(1), time + model.time_step
                )
            position = moved
            if wp.static(f.periodic or f.inlet):
                position = kept_in_space(model, state, readout, world, b, position, step + wp.int64(1))
        state.position[world, b] = position
        if wp.static(monitor):
            monitors = look(model, bead, monitors, world, position, start, taken)
            report_escape(readout, monitors.first, world, 0, start)
            if wp.static(f.traps == FEW_TRAPS):
                report_escape(readout, monitors.second, world, 1, start)

    return bead_step


def make_body_step(f: Features) -> wp.Kernel:
    """Step for bodies of which some rotate."""
    constants_of, dynamics = body_dynamics(f)
    place_of, moved_by = place_term(f), dynamics.shifted
    move_freely = whole_step(INTEGRATORS[f.integrator], dynamics)
    record_escapes, way_of = (escape_term(f), way_term(f)) if f.escapes else (None, None)
    keep_aims, list_pairs, kept_in_space = keep_aims_term(f), list_pairs_term(f), kept_in_space_term(f)

    how = {"grid_stride": False, "launch_bounds": f.launch_bounds, "module_options": f.module_options}

    @wp.kernel(module="unique", enable_backward=False, **how)
    def body_step(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, first_world: int,
        first_step: wp.int64, steps: int,
    ):  # fmt: skip
        """Take `steps` steps from `first_step` for the worlds from `first_world` on, one body a thread."""
        world, b, start = place_of(model, first_world, first_step, wp.tid())
        if wp.static(f.episodes):
            if world < 0:
                return
        pose = Pose(state.position[world, b], state.orientation[world, b])
        body = constants_of(model, control, world, b)
        bound = model.body.bound[b]
        leeway = float(0.0)
        if wp.static(f.listed):
            room = wp.zeros(shape=(thread_rows.LOCAL,), dtype=wp.vec4)
            body.rows = thread_rows.rows_at(room)
            keep_aims(model, control, body, world, b)
        for i in range(steps):
            step = start + wp.int64(i)
            time = wp.float64(step) * model.time_step
            if wp.static(f.listed):
                if any_beside(not body.leeway > 0.0):
                    listed, pairs, free = list_pairs(model, control, body, world, b, pose, time)
                    body.listed = listed
                    body.pairs = pairs
                    body.leeway = free
            move = move_freely(model, control, state, body, world, b, pose, step, time)
            if not finite(pose.position + linear_part(move) + angular_part(move)):
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                break
            before = pose
            pose = moved_by(before, move)
            if wp.static(f.walls > 0):
                pose.position = pose.position + out_of_walls(model.walls, b, pose)
            if wp.static(f.escapes):
                way = way_of(model, control, world, pose.position - before.position, angular_part(move), bound)
                if wp.static(f.listed):
                    body.leeway -= way
                # monitored closely only where something can be lost
                leeway -= way
                if any_beside(leeway <= 0.0):
                    arrival = step + wp.int64(1)
                    later = time + model.time_step
                    leeway = record_escapes(model, control, state, readout, world, b, before, pose, arrival, later)
            if wp.static(f.periodic or f.inlet):
                pose.position = kept_in_space(model, state, readout, world, b, pose.position, step + wp.int64(1))
        state.position[world, b] = pose.position
        state.orientation[world, b] = pose.rotation

    return body_step
