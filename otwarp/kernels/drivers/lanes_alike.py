"""Lanes that are alike: the physics of a lone sphere in `GROUP` worlds at once, in a CPU's vector registers.

Where a sphere has the same constants in all worlds of a thread, these differ in places and noise, if any. The compiler
makes vector code of a loop over them, as wide as the processor's registers, from the same functions of one sphere that
every other form calls: results have the same bits. What a vector cannot do, a fault or a look at a sphere that may
escape, ends the attempt, and the steps are taken again one sphere at a time.
"""

import warp as wp

from otwarp.kernels.bodies.bead import bead_dynamics
from otwarp.kernels.core.faults import finite
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.packed import point_of, power_of
from otwarp.kernels.core.step_constants import BeadConstants
from otwarp.kernels.core.types import ControlData, ModelData, StateData
from otwarp.kernels.cpu.noise_block import address_of, before_step, worlds_block_term
from otwarp.kernels.drivers.lane_groups import GROUP, BeadLane, draws_blocks
from otwarp.kernels.integrate.integrators import INTEGRATORS, whole_step
from otwarp.kernels.optics.traps import TABLE_KEY, trap_term

WIDE = "-march=native -mprefer-vector-width=512"
"""How the compiler is told to use the widest vectors that there are: by itself it shuns those of AVX-512."""


def go_together(f: Features) -> bool:
    """Whether spheres of many worlds can share vectors: one a world, nothing to keep but places, no look-ups.

    Traps that follow key frames and tables would be found for one lane after the other.
    """
    kept = f.rigid or f.periodic or f.inlet or f.walls or f.episodes or (f.escapes and not f.monitors)
    looked_up = not f.still_traps or any(trap_term(name).key >= TABLE_KEY for name in f.trap_models)
    ahead = INTEGRATORS[f.integrator].noise_ahead > 0
    return f.bodies == 1 and not (kept or looked_up or ahead)


@wp.func_native("""
    const unsigned int* a = (const unsigned int*)&one;
    const unsigned int* b = (const unsigned int*)&other;
    unsigned int differ = 0;
    for (; a < (const unsigned int*)(&one.second_anchor + 1); ++a, ++b)
        differ |= *a ^ *b;
    return differ == 0;
""")
def same_bits(one: BeadConstants, other: BeadConstants) -> bool:
    """Whether two spheres have the same constants, but for where their noise is."""
    ...


def alike_term(f: Features) -> wp.Function:
    """`(lanes, bodies) -> bool`: whether these lanes are `GROUP` spheres with the same constants."""

    @wp.func
    def alike(lanes: wp.array(dtype=BeadLane), bodies: int) -> bool:
        """Whether all lanes are in use and alike; spheres that traps of the scene do not act on are left alone."""
        same = bodies == GROUP
        if wp.static(bool(f.trap_models)):
            same = same and lanes[0].bead.trapped != 0
        for g in range(1, bodies):
            same = same and same_bits(lanes[0].bead, lanes[g].bead)
        return same

    return alike


ROOM = 3 * GROUP + 3 * GROUP + 4 * GROUP
"""Floats that lanes which are alike need: a step's deviates, places, and two rows for each of two monitors."""

_NEAR, _LAST = (wp.constant(row * GROUP) for row in (6, 7))


@wp.func_native("""
    const float* from = room.data + 48 + g;
    return wp::vec_t<3, wp::float32>(from[0], from[16], from[32]);
""")
def place_of(room: wp.array(dtype=wp.float32), g: int) -> wp.vec3:
    """Place [µm] of the sphere in lane g, kept component by component behind a step's deviates."""
    ...


@wp.func_native("""
    float* to = room.data + 48 + g;
    to[0] = place[0];
    to[16] = place[1];
    to[32] = place[2];
""")
def put_at(room: wp.array(dtype=wp.float32), g: int, place: wp.vec3):
    """Put the sphere in lane g at a place [µm]."""
    ...


@wp.func_native("""
    return room.data[row + g];
""")
def value_of(room: wp.array(dtype=wp.float32), row: int, g: int) -> float:
    """What lane g has in the row that begins with float `row`."""
    ...


@wp.func_native("""
    room.data[row + g] = value;
""")
def put_value(room: wp.array(dtype=wp.float32), row: int, g: int, value: float):
    """Give lane g a value in the row that begins with float `row`."""
    ...


@wp.func
def calm(room: wp.array(dtype=wp.float32), monitor: int, g: int, here: wp.vec3, anchor: wp.vec4) -> int:
    """Whether nothing can have left a trap in lane g, 1 or 0, as `monitor_term` begins its look at `here` [µm]."""
    row = wp.static(2 * GROUP) * monitor
    away2 = wp.length_sq(here - point_of(anchor))
    far2 = wp.max(away2, value_of(room, row + _LAST, g))
    put_value(room, row + _LAST, g, away2)
    return wp.where(far2 > value_of(room, row + _NEAR, g) and power_of(anchor) > 0.0, 0, 1)


def exchange_terms(monitors: int) -> tuple[wp.Function, wp.Function]:
    """`(room, lanes)`: lay the lanes out component by component, and put what changed back into them.

    Args:
        monitors: How many a lane has.
    """

    @wp.func
    def lay_out(room: wp.array(dtype=wp.float32), lanes: wp.array(dtype=BeadLane)):
        """Places [µm], and what the monitors look for."""
        bodies = int(GROUP)
        for g in range(bodies):
            put_at(room, g, lanes[g].position)
            if wp.static(monitors > 0):
                put_value(room, _NEAR, g, lanes[g].first.near2)
                put_value(room, _LAST, g, lanes[g].first.last2)
            if wp.static(monitors > 1):
                put_value(room, _NEAR + wp.static(2 * GROUP), g, lanes[g].second.near2)
                put_value(room, _LAST + wp.static(2 * GROUP), g, lanes[g].second.last2)

    @wp.func
    def put_back(room: wp.array(dtype=wp.float32), lanes: wp.array(dtype=BeadLane)):
        """Places [µm], and what the monitors saw last."""
        bodies = int(GROUP)
        for g in range(bodies):
            lanes[g].position = place_of(room, g)
            if wp.static(monitors > 0):
                lanes[g].first.last2 = value_of(room, _LAST, g)
            if wp.static(monitors > 1):
                lanes[g].second.last2 = value_of(room, _LAST + wp.static(2 * GROUP), g)

    return lay_out, put_back


def step_together_term(f: Features) -> wp.Function:
    """`(model, control, state, lanes, room, world, first_step, done, steps) -> bool`: steps of lanes that are alike.

    `room` holds `ROOM` floats. False if a sphere had a fault, has stopped, or may escape: the lanes are as they were.
    """
    move_freely = whole_step(INTEGRATORS[f.integrator], bead_dynamics(f))
    draw = worlds_block_term(f.noise) if draws_blocks(f) else None
    monitors = f.monitors
    lay_out, put_back = exchange_terms(monitors)

    @wp.func
    def one_step(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, room: wp.array(dtype=wp.float32),
        world: int, step: wp.int64,
    ) -> int:  # fmt: skip
        """Move the spheres of the worlds from `world` on [µm]; 0 if that does not count. A loop without branches."""
        fine = int(1)
        time = wp.float64(step) * model.time_step
        if wp.static(draw is not None):
            draw(room, 0, model.seed, step, world)
        # as all of them are: a branch less, without which this is no vector code
        bead.trapped = 1
        g = int(0)
        while g < GROUP:
            here = place_of(room, g)
            if wp.static(monitors > 0):
                fine = wp.min(fine, calm(room, 0, g, here, bead.first_anchor))
            if wp.static(monitors > 1):
                fine = wp.min(fine, calm(room, 1, g, here, bead.second_anchor))
            if wp.static(draw is not None):
                bead.deviates = before_step(address_of(room, g), step)
            moved = here + move_freely(model, control, state, bead, world + g, 0, here, step, time)
            fine = wp.where(finite(moved), fine, 0)
            put_at(room, g, moved)
            g += 1
        return fine

    @wp.func
    def step_together(
        model: ModelData, control: ControlData, state: StateData, lanes: wp.array(dtype=BeadLane),
        room: wp.array(dtype=wp.float32), world: int, first_step: wp.int64, done: int, steps: int,
    ) -> bool:  # fmt: skip
        """Take `steps` steps more than the `done` ones, with the lanes of the worlds from `world` on."""
        fine = int(1)
        bodies = int(GROUP)
        for g in range(bodies):
            fine = wp.where(lanes[g].until > done, fine, 0)
        if fine != 0:
            lay_out(room, lanes)
            for k in range(done, done + steps):
                step = first_step + wp.int64(k)
                fine = wp.min(fine, one_step(model, control, state, lanes[0].bead, room, world, step))
        if fine != 0:
            put_back(room, lanes)
        return fine != 0

    return step_together
