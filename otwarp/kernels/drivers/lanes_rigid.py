"""Lanes of bodies of which some rotate: see `otwarp.kernels.drivers.lanes`.

What a rigid body's step multiplies by is laid out for vector registers at the start, see `rigid_block`.
"""

import warp as wp

from otwarp.kernels.bodies.rigid import angular_part, linear_part
from otwarp.kernels.bodies.rotational_noise import PART
from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.faults import Fault, finite, raise_fault
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BodyConstants, RigidConstants
from otwarp.kernels.core.types import ControlData, ModelData, Pose, ReadoutData, StateData
from otwarp.kernels.core.worlds import number_term, start_term, world_term, worlds_term
from otwarp.kernels.cpu.noise_block import BLOCK, address_of, before_step, noise_block_term
from otwarp.kernels.cpu.rigid_block import KEPT, keep, make_kicks
from otwarp.kernels.drivers.inlets import kept_in_space_term
from otwarp.kernels.drivers.lane_groups import GROUP, draws_blocks, fresh_steps, from_start, view_term
from otwarp.kernels.integrate.body import body_dynamics
from otwarp.kernels.integrate.integrators import INTEGRATORS, whole_step
from otwarp.kernels.optics.escapes import escape_term, way_term


def body_lane(constants: type) -> type:
    """Struct of a body on its way.

    `until` is the step of the launch at which it stops, `leeway` how far it may go before an escape is possible [µm].
    """

    @wp.struct
    class BodyLane:
        pose: Pose
        until: wp.int32
        leeway: wp.float32
        body: constants

    return BodyLane


LANE_OF = {RigidConstants: body_lane(RigidConstants), BodyConstants: body_lane(BodyConstants)}


def deviates_term(f: Features) -> wp.Function:
    """`(model, constants, buffer, at, first, world, b) -> constants` that read the block of noise just drawn."""
    kind = BodyConstants if f.spheres else RigidConstants
    draw_three = noise_block_term(f.noise, 3)
    draw_six = noise_block_term(f.noise, 6)
    number = number_term(f)

    @wp.func
    def of_rigid(
        model: ModelData, body: RigidConstants, buffer: wp.array(dtype=wp.float32), at: int, first: wp.int64,
        world: int, b: int,
    ) -> RigidConstants:  # fmt: skip
        """The constants with the address of a fresh block of kicks."""
        draw_six(buffer, at, model.seed, first, number(model, world), b)
        make_kicks(buffer, at, body.kept, PART)
        body.kicks = before_step(address_of(buffer, at), first)
        return body

    @wp.func
    def of_either(
        model: ModelData, body: BodyConstants, buffer: wp.array(dtype=wp.float32), at: int, first: wp.int64, world: int,
        b: int,
    ) -> BodyConstants:  # fmt: skip
        """The constants with the address of a fresh block: kicks of a rigid body, else three deviates per step."""
        if body.turns != 0:
            body.rigid = of_rigid(model, body.rigid, buffer, at, first, world, b)
        else:
            draw_three(buffer, at, model.seed, first, number(model, world), b)
            body.bead.deviates = before_step(address_of(buffer, at), first)
        return body

    return of_either if kind is BodyConstants else of_rigid


def kept_term(f: Features) -> wp.Function:
    """`(model, constants, buffer, at, b) -> constants` that know where they are laid out."""

    @wp.func
    def of_rigid(
        model: ModelData, body: RigidConstants, buffer: wp.array(dtype=wp.float32), at: int, b: int
    ) -> RigidConstants:
        """The constants with the address where mobility, noise factor, aims and trapped spheres are laid out."""
        body.kept = keep(
            buffer,
            at,
            body.translation,
            body.coupling,
            body.rotation,
            body.translation_root,
            body.coupling_root,
            body.rotation_root,
            body.aims,
            body.reaches,
            model.body.trapped,
            model.body.trapped_start[b],
            model.body.trapped_start[b + 1],
        )
        return body

    @wp.func
    def of_either(
        model: ModelData, body: BodyConstants, buffer: wp.array(dtype=wp.float32), at: int, b: int
    ) -> BodyConstants:
        """The constants with the layout of a rigid body; those of a sphere unchanged."""
        if body.turns != 0:
            body.rigid = of_rigid(model, body.rigid, buffer, at, b)
        return body

    return of_either if f.spheres else of_rigid


def make_body_lanes(f: Features) -> wp.Kernel:
    """Step for bodies of which some rotate, as `make_body_step`."""
    constants_of, dynamics = body_dynamics(f)
    lane_type = LANE_OF[dynamics.constants]
    lanes_at = view_term(lane_type)
    advance = body_advance_term(f, dynamics, lane_type)
    with_deviates = deviates_term(f) if draws_blocks(f) else None
    with_kept = kept_term(f)
    fresh = fresh_steps(f)
    worlds_in, world_in, start_of = worlds_term(f), world_term(f), start_term(f)

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False)
    def body_lanes(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData, first_world: int,
        first_step: wp.int64, steps: int, worlds: int,
    ):  # fmt: skip
        """Take `steps` steps from `first_step` for `worlds` worlds from `first_world` on, `GROUP` bodies a thread."""
        before = wp.tid() * GROUP
        bodies = wp.min(GROUP, worlds_in(model, first_world, worlds) * wp.static(f.bodies) - before)
        deviates = wp.zeros(shape=(wp.static(GROUP * 6 * BLOCK),), dtype=wp.float32)
        kept = wp.zeros(shape=(wp.static(GROUP * KEPT),), dtype=wp.float32)
        room = wp.zeros(shape=(GROUP,), dtype=lane_type)
        lanes = wp.array(ptr=lanes_at(room), shape=(GROUP,), dtype=lane_type)
        # names differ from loop to loop: one that came back would be carried from turn to turn
        for g0 in range(bodies):
            w0 = world_in(model, first_world + (before + g0) // wp.static(f.bodies))
            b0 = (before + g0) % wp.static(f.bodies)
            lanes[g0].pose = Pose(state.position[w0, b0], state.orientation[w0, b0])
            lanes[g0].body = with_kept(model, constants_of(model, control, w0, b0), kept, KEPT * g0, b0)
            lanes[g0].until = steps
            lanes[g0].leeway = 0.0
        done = int(0)
        while done < steps:
            if wp.static(with_deviates is not None):
                for g1 in range(bodies):
                    w1 = world_in(model, first_world + (before + g1) // wp.static(f.bodies))
                    b1 = (before + g1) % wp.static(f.bodies)
                    now = start_of(model, w1, first_step) + wp.int64(done)
                    at = wp.static(6 * BLOCK) * g1
                    lanes[g1].body = with_deviates(model, lanes[g1].body, deviates, at, now, w1, b1)
            for k in range(done, wp.min(done + wp.static(fresh), steps)):
                for g2 in range(bodies):
                    w2 = world_in(model, first_world + (before + g2) // wp.static(f.bodies))
                    b2 = (before + g2) % wp.static(f.bodies)
                    first = start_of(model, w2, first_step)
                    advance(model, control, state, readout, lanes, from_start(g2), w2, b2, first, k)
            done += wp.static(fresh)
        for g3 in range(bodies):
            w3 = world_in(model, first_world + (before + g3) // wp.static(f.bodies))
            b3 = (before + g3) % wp.static(f.bodies)
            state.position[w3, b3] = lanes[g3].pose.position
            state.orientation[w3, b3] = lanes[g3].pose.rotation

    return body_lanes


def body_advance_term(f: Features, dynamics: Dynamics, lane_type: type) -> wp.Function:
    """`(model, control, state, readout, lanes, g, world, b, first, k)`: step k of lane g."""
    move_freely = whole_step(INTEGRATORS[f.integrator], dynamics)
    moved_by = dynamics.shifted
    record_escapes, way_of = (escape_term(f), way_term(f)) if f.escapes else (None, None)
    kept_in_space = kept_in_space_term(f)

    @wp.func
    def advance(
        model: ModelData, control: ControlData, state: StateData, readout: ReadoutData,
        lanes: wp.array(dtype=lane_type), g: int, world: int, b: int, first: wp.int64, k: int,
    ):  # fmt: skip
        """Step k of lane g: move, and record escapes once the leeway [µm] is used up."""
        if k < lanes[g].until:
            step = first + wp.int64(k)
            time = wp.float64(step) * model.time_step
            here = lanes[g].pose
            move = move_freely(model, control, state, lanes[g].body, world, b, here, step, time)
            if finite(here.position + linear_part(move) + angular_part(move)):
                there = moved_by(here, move)
                lanes[g].pose = there
                if wp.static(f.escapes):
                    moved = there.position - here.position
                    way = way_of(model, control, world, moved, angular_part(move), model.body.bound[b])
                    leeway = lanes[g].leeway - way
                    # monitored closely only where something can be lost
                    if leeway <= 0.0:
                        arrival = step + wp.int64(1)
                        later = time + model.time_step
                        leeway = record_escapes(model, control, state, readout, world, b, here, there, arrival, later)
                    lanes[g].leeway = leeway
                if wp.static(f.periodic or f.inlet):
                    arrived = step + wp.int64(1)
                    lanes[g].pose.position = kept_in_space(model, state, readout, world, b, there.position, arrived)
            else:
                raise_fault(readout, world, b, wp.static(int(Fault.NON_FINITE)), step)
                lanes[g].until = k

    return advance
