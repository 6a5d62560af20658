"""The free move of a body as the kernels of the grid driver take it: everything but contact, at the present step.

It comes in the integrator's two stages, with the contacts solved after each.

On a CPU the noise of lone spheres comes for 16 of them at once, in vector registers: the arithmetic of `noise_block`
with a body in each lane instead of a step. A deviate has the same bits either way, whatever shares a block with it.
"""

import functools

import warp as wp

from otwarp.kernels.bodies.bead import bead_constants_term, bead_dynamics
from otwarp.kernels.bodies.rigid import angular_part, linear_part, twist
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BeadConstants
from otwarp.kernels.core.types import ControlData, ModelData, Move, Pose, StateData
from otwarp.kernels.core.worlds import number_term
from otwarp.kernels.cpu.noise_block import BLOCK, before_step, block_source
from otwarp.kernels.drivers.grid.data import GridData, PushData, body_pose_term, own_term
from otwarp.kernels.forces.locality import needs_place_term
from otwarp.kernels.integrate.body import as_move, body_dynamics
from otwarp.kernels.integrate.integrators import INTEGRATORS


@functools.lru_cache(maxsize=4)
def body_block_term(noise: str) -> wp.Function:
    """`(buffer, room, seed, first, world, bodies, at, count)`: three deviates for the step `first` of up to 16 bodies.

    Deviate c of body `bodies[at + k]` goes to `buffer[room + 16 c + k]`; k < count ≤ 16.

    Args:
        noise: One of `NOISES`.
    """

    @wp.func_native(block_source(noise, 3, "bodies"))
    def body_block(
        buffer: wp.array(dtype=wp.float32), room: int, seed: wp.uint32, first: wp.int64, world: int,
        bodies: wp.array2d(dtype=wp.int32), at: int, count: int,
    ):  # fmt: skip
        """Write three deviates of mean 0 and variance 1 for each of `count` bodies, in a CPU's vector registers."""
        ...

    return body_block


def draw_block_term(f: Features) -> wp.Function:
    """`(model, grid, buffer, to, world, i, count)`: the noise of the bodies in `count` slots of a world from i on."""
    body_block = body_block_term(f.noise)
    number, own = number_term(f), own_term(f)

    @wp.func
    def draw_block(
        model: ModelData, grid: GridData, buffer: wp.array(dtype=wp.float32), to: int, world: int, i: int, count: int
    ):
        """Draw the deviates of the step that the clock shows for the bodies in `count` slots from i on."""
        at = grid.turn[0] * grid.order.shape[1] + i
        body_block(buffer, to, model.seed, grid.clock[own(world)], number(model, world), grid.order, at, count)

    return draw_block


def grid_move_term(f: Features) -> wp.Function:
    """`(model, control, state, grid, world, b, pose, block, k) -> (Move, Move)` in the step that the clock shows.

    The integrator's first stage without contact, and the drift in it. With `lanes` or `blocks` the noise of lone
    spheres is that of place k in a block at the address `block`; else these do not matter.
    """
    if f.lanes:
        return _move_in_block_term(f)
    constants_of, dynamics = body_dynamics(f)
    predict = INTEGRATORS[f.integrator].predict(dynamics)
    own = own_term(f)

    @wp.func
    def grid_move(
        model: ModelData, control: ControlData, state: StateData, grid: GridData, world: int, b: int, pose: Pose,
        block: wp.uint64, k: int,
    ):  # fmt: skip
        """Move of the first stage and its drift [µm, rad] of body b."""
        step = grid.clock[own(world)]
        time = wp.float64(step) * model.time_step
        body = constants_of(model, control, world, b)
        if wp.static(f.blocks):
            body.bead.deviates = before_step(block, step - wp.int64(k))
        move, drift = predict(model, control, state, body, world, b, pose, step, time)
        return as_move(move), as_move(drift)

    return grid_move


def bead_move_term(f: Features) -> wp.Function:
    """`(model, control, state, grid, bead, world, b, position, block, k) -> (vec3, vec3)`: see `grid_move_term`.

    Move and drift of a lone sphere whose constants are known, with the noise of place k in a block.
    """
    predict = INTEGRATORS[f.integrator].predict(bead_dynamics(f))
    own = own_term(f)

    @wp.func
    def bead_move(
        model: ModelData, control: ControlData, state: StateData, grid: GridData, bead: BeadConstants, world: int,
        b: int, position: wp.vec3, block: wp.uint64, k: int,
    ):  # fmt: skip
        """Move of the first stage and its drift [µm] of the lone sphere b."""
        step = grid.clock[own(world)]
        bead.deviates = before_step(block, step - wp.int64(k))
        time = wp.float64(step) * model.time_step
        move, drift = predict(model, control, state, bead, world, b, position, step, time)
        return move, drift

    return bead_move


def _move_in_block_term(f: Features) -> wp.Function:
    """The same for lone spheres with noise from a block."""
    bead_constants = bead_constants_term(f)
    bead_move = bead_move_term(f)

    @wp.func
    def move_in_block(
        model: ModelData, control: ControlData, state: StateData, grid: GridData, world: int, b: int, pose: Pose,
        block: wp.uint64, k: int,
    ):  # fmt: skip
        """Move of the first stage and its drift [µm] of the lone sphere b, with noise from place k of a block."""
        bead = bead_constants(model, control, world, b)
        move, drift = bead_move(model, control, state, grid, bead, world, b, pose.position, block, k)
        return Move(move, wp.vec3(0.0)), Move(drift, wp.vec3(0.0))

    return move_in_block


def two_stages(f: Features) -> bool:
    """Whether the integrator looks a second time, at where the bodies have come to with their contacts."""
    return INTEGRATORS[f.integrator].correct is not None and not f.soft_contacts


def correct_term(f: Features) -> wp.Function:
    """`(model, control, state, grid, push, world, b)`: what the second stage adds to the free displacement."""
    scheme = INTEGRATORS[f.integrator]
    constants_of, dynamics = body_dynamics(f)
    assert scheme.correct is not None
    correction = scheme.correct(dynamics)
    body_pose, own = body_pose_term(f), own_term(f)
    may_differ = needs_place_term(f)

    @wp.func
    def correct_body(
        model: ModelData, control: ControlData, state: StateData, grid: GridData, push: PushData, world: int, b: int
    ):
        """Add the second stage of body b to its free move [µm, rad], looked at from where contacts let it come to.

        Of a body on which drift may depend on place; that of others is what it was.
        """
        if not may_differ(model, b):
            return
        step = grid.clock[own(world)]
        linear = grid.linear[world, b]
        angular = wp.vec3(0.0)
        drift = twist(grid.drift[world, b], wp.vec3(0.0))
        if wp.static(f.rigid):
            angular = grid.angular[world, b]
            drift = twist(grid.drift[world, b], grid.turning[world, b])
        moved = twist(linear, angular)
        if wp.static(f.contacts):
            if wp.static(f.in_turn) or grid.count[world, b] > 0:
                moved += twist(push.linear[world, b], wp.vec3(0.0))
                if wp.static(f.rigid):
                    moved += twist(wp.vec3(0.0), push.angular[world, b])
        body = constants_of(model, control, world, b)
        pose = body_pose(state, world, b)
        time = wp.float64(step) * model.time_step
        change = correction(model, control, state, body, world, b, pose, drift, moved, step, time)
        grid.linear[world, b] = linear + linear_part(change)
        if wp.static(f.rigid):
            grid.angular[world, b] = angular + angular_part(change)

    return correct_body


def make_correct(f: Features) -> wp.Kernel:
    """Kernel over (world, share of its bodies): the integrator's second stage."""
    correct_body = correct_term(f)

    @wp.kernel(module="unique", enable_backward=False, module_options=f.module_options)
    def correct(
        model: ModelData, control: ControlData, state: StateData, grid: GridData, push: PushData, size: int
    ):  # fmt: skip
        """Second stage of the `size` bodies of one share."""
        world, share = wp.tid()
        for b in range(share * size, wp.min((share + 1) * size, model.bodies)):
            correct_body(model, control, state, grid, push, world, b)

    return correct


__all__ = [
    "BLOCK",
    "bead_move_term",
    "body_block_term",
    "correct_term",
    "draw_block_term",
    "grid_move_term",
    "make_correct",
    "two_stages",
]
