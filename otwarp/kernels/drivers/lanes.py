"""The `solo` driver's form for CPUs: noise of many steps in one go, and a few bodies at a time in every thread.

Warp's threads on a CPU run one after another. The steps of one body depend on each other, so that a processor which
could do several things at once would wait; the steps of different bodies do not. A thread therefore owns `GROUP` bodies
and takes all of them through a step before the next, with the noise of the next steps from `noise_block`. Every body
goes through the same operations as in a thread of its own: results do not depend on what shares a thread with it.
"""

import warp as wp

from otwarp.kernels.bodies.bead import bead_constants_term, bead_dynamics
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import CPU_FLAGS, Features
from otwarp.kernels.core.types import ControlData, ModelData, Pose, ReadoutData, StateData
from otwarp.kernels.core.worlds import number_term, start_term, world_term, worlds_term
from otwarp.kernels.cpu.noise_block import BLOCK, address_of, before_step, noise_block_term
from otwarp.kernels.drivers.inlets import kept_in_space_term
from otwarp.kernels.drivers.lane_groups import (
    GROUP,
    BeadLane,
    bead_lanes_at,
    draws_blocks,
    fresh_steps,
    from_start,
)
from otwarp.kernels.drivers.lanes_alike import WIDE, alike_term, step_together_term
from otwarp.kernels.drivers.lanes_rigid import make_body_lanes
from otwarp.kernels.forces.traps import next_pieces_term, takes_pieces
from otwarp.kernels.integrate.integrators import INTEGRATORS, whole_step
from otwarp.kernels.optics.escapes import EscapeMonitor, escape_term, monitor_term, report_escape, start_monitor
from otwarp.kernels.optics.trap_command import kept_anchor_term


def make_lanes_step(f: Features) -> wp.Kernel:
    """Step of the `solo` driver on a CPU.

    Launched with `threads_for` all bodies of the launch; its last argument is the number of worlds of the launch.
    """
    return make_body_lanes(f) if f.rigid else make_bead_lanes(f)


def module_options(f: Features) -> dict[str, str]:
    """How Warp compiles the step of lone spheres: with a flow, whatever its size in one piece."""
    flags = " ".join((CPU_FLAGS,) * bool(f.flow) + (WIDE,) * f.vectors)
    return {"cpu_compiler_flags": flags} if flags else {}


def start_lanes_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, lanes, first_world, before, bodies, first_step, steps)`: of a launch."""
    start, world_in, start_of = start_lane_term(f), world_term(f), start_term(f)

    @wp.func
    def start_lanes(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, lanes: wp.array(dtype=BeadLane),
        first_world: int, before: int, bodies: int, first_step: wp.int64, steps: int,
    ):  # fmt: skip
        """Put `bodies` spheres, the first of which is `before` after the first of `first_world`, on their ways."""
        for g in range(bodies):
            world = world_in(model, first_world + (before + g) // wp.static(f.bodies))
            lanes[g] = start(model, control, state, readout, world, (before + g) % wp.static(f.bodies))
            lanes[g].until = steps
            if wp.static(f.episodes):
                # which would have to be looked up in every step
                lanes[g].start = start_of(model, world, first_step)
                lanes[g].world = world

    return start_lanes


def make_bead_lanes(f: Features) -> wp.Kernel:
    """Step for lone spheres, as `make_bead_step`."""
    start, advance, finish = start_lanes_term(f), advance_lane_term(f), finish_lane_term(f)
    draw = noise_block_term(f.noise, 3) if draws_blocks(f) else None
    fresh = fresh_steps(f)
    alike, step_together = (alike_term(f), step_together_term(f)) if f.vectors else (None, None)
    number = number_term(f)
    worlds_in, world_in, start_of = worlds_term(f), world_term(f), start_term(f)

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False, module_options=module_options(f))
    def bead_lanes(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, first_world: int,
        first_step: wp.int64, steps: int, worlds: int,
    ):  # fmt: skip
        """Take `steps` steps from `first_step` for `worlds` worlds from `first_world` on, `GROUP` spheres a thread."""
        before = wp.tid() * GROUP
        bodies = wp.min(GROUP, worlds_in(model, first_world, worlds) * wp.static(f.bodies) - before)
        deviates = wp.zeros(shape=(wp.static(GROUP * 3 * BLOCK),), dtype=wp.float32)
        room = wp.zeros(shape=(GROUP,), dtype=BeadLane)
        lanes = wp.array(ptr=bead_lanes_at(room), shape=(GROUP,), dtype=BeadLane)
        start(model, control, state, readout, lanes, first_world, before, bodies, first_step, steps)
        together = bool(False)
        if wp.static(step_together is not None):
            together = alike(lanes, bodies)
        done = int(0)
        while done < steps:
            count = wp.min(wp.static(fresh), steps - done)
            stepped = bool(False)
            if wp.static(step_together is not None):
                if together:
                    world = first_world + before
                    stepped = step_together(model, control, state, lanes, deviates, world, first_step, done, count)
            if not stepped:
                if wp.static(draw is not None):
                    # names differ from loop to loop: one that came back would be carried from turn to turn
                    for g1 in range(bodies):
                        w1 = world_in(model, first_world + (before + g1) // wp.static(f.bodies))
                        b1 = (before + g1) % wp.static(f.bodies)
                        now = start_of(model, w1, first_step) + wp.int64(done)
                        draw(deviates, wp.static(3 * BLOCK) * g1, model.seed, now, number(model, w1), b1)
                        lanes[g1].bead.deviates = before_step(address_of(deviates, wp.static(3 * BLOCK) * g1), now)
                for k in range(done, done + count):
                    for g2 in range(bodies):
                        w2 = first_world + (before + g2) // wp.static(f.bodies)
                        first = first_step
                        if wp.static(f.episodes):
                            w2 = lanes[g2].world
                            first = lanes[g2].start
                        b2 = (before + g2) % wp.static(f.bodies)
                        advance(model, control, state, readout, lanes, from_start(g2), w2, b2, first, k)
            done += count
        for g3 in range(bodies):
            w3 = world_in(model, first_world + (before + g3) // wp.static(f.bodies))
            b3 = (before + g3) % wp.static(f.bodies)
            finish(model, state, readout, lanes[g3], w3, b3, start_of(model, w3, first_step))

    return bead_lanes


def look_term(f: Features) -> wp.Function:
    """`(model, lane, world, first, taken) -> two monitors`: what the first two traps see by then."""
    monitors = f.monitors
    monitored, kept_anchor = monitor_term(f), kept_anchor_term(f)

    @wp.func
    def look(
        model: ModelData, lane: BeadLane, world: int, first: wp.int64, taken: int
    ) -> tuple[EscapeMonitor, EscapeMonitor]:
        """Monitors of the first two traps after `taken` steps; those that no trap needs come back unchanged."""
        bead = lane.bead
        one = lane.first
        two = lane.second
        time = wp.float64(first + wp.int64(taken)) * model.time_step
        if wp.static(monitors > 0):
            anchor = kept_anchor(bead.first, bead.first_anchor, bead.first_glide, time)
            one = monitored(model, bead, one, anchor, world, 0, lane.position, first, taken)
        if wp.static(monitors > 1):
            other = kept_anchor(bead.second, bead.second_anchor, bead.second_glide, time)
            two = monitored(model, bead, two, other, world, 1, lane.position, first, taken)
        return one, two

    return look


def start_lane_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, world, b) -> BeadLane` at the start of a launch."""
    bead_constants = bead_constants_term(f)
    monitors = f.monitors

    @wp.func
    def start(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, world: int, b: int
    ) -> BeadLane:
        """Lane of sphere b: its constants, position [µm] and escape monitors at the start of a launch."""
        lane = BeadLane()
        lane.position = state.position[world, b]
        lane.bead = bead_constants(model, control, world, b)
        if wp.static(monitors > 0):
            lane.first = start_monitor(model.traps, readout, lane.bead, world, b, 0)
        if wp.static(monitors > 1):
            lane.second = start_monitor(model.traps, readout, lane.bead, world, b, 1)
        return lane

    return start


def advance_lane_term(f: Features) -> wp.Function:
    """`(model, control, state, readout, lanes, g, world, b, first, k)`: step k of the launch for lane g."""
    move_freely = whole_step(INTEGRATORS[f.integrator], bead_dynamics(f))
    next_pieces = next_pieces_term(f)
    monitors = f.monitors
    look = look_term(f)
    record_escapes = escape_term(f) if f.escapes and not monitors else None
    kept_in_space = kept_in_space_term(f)

    @wp.func
    def advance(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData,
        lanes: wp.array(dtype=BeadLane), g: int, world: int, b: int, first: wp.int64, k: int,
    ):  # fmt: skip
        """Step k of lane g: monitor the traps, move, and record escapes of traps without a monitor."""
        if k < lanes[g].until:
            lane = lanes[g]
            if wp.static(monitors > 0):
                one, two = look(model, lane, world, first, k)
                lanes[g].first = one
                if wp.static(monitors > 1):
                    lanes[g].second = two
            step = first + wp.int64(k)
            time = wp.float64(step) * model.time_step
            here = lane.position
            if wp.static(takes_pieces(f)):
                lane.bead = next_pieces(model, control, lane.bead, time)
                lanes[g].bead.first_piece = lane.bead.first_piece
                lanes[g].bead.second_piece = lane.bead.second_piece
            moved = here + move_freely(model, control, state, lane.bead, world, b, here, step, time)
            if finite(moved):
                lanes[g].position = moved
                if wp.static(record_escapes is not None):
                    left = Pose(here, wp.quat_identity())
                    reached = Pose(moved, wp.quat_identity())
                    later = time + model.time_step
                    record_escapes(model, control, state, readout, world, b, left, reached, step + wp.int64(1), later)
                if wp.static(f.periodic or f.inlet):
                    lanes[g].position = kept_in_space(model, state, readout, world, b, moved, step + wp.int64(1))
            else:
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                lanes[g].until = k

    return advance


def finish_lane_term(f: Features) -> wp.Function:
    """`(model, state, readout, lane, world, b, first)` at the end of a launch."""
    monitors = f.monitors
    look = look_term(f)

    @wp.func
    def finish(
        model: ModelData, state: StateData, readout: ReadoutData, lane: BeadLane, world: int, b: int, first: wp.int64
    ):  # fmt: skip
        """Write the position [µm] back, and report escapes up to the last step."""
        state.position[world, b] = lane.position
        one, two = look(model, lane, world, first, lane.until)
        if wp.static(monitors > 0):
            report_escape(readout, one, world, 0, first)
        if wp.static(monitors > 1):
            report_escape(readout, two, world, 1, first)

    return finish
