"""Optical traps: where they are, and the force each exerts on a sphere.

A force model is three functions: `prepare(traps, world, trap, radius, kind) -> TrapConstants` gathers what stays the
same over a run, `force(traps, law, displacement) -> force per mW` evaluates it, and `stiffness(traps, law,
displacement) -> mat33 per mW` is the symmetric part of −∂F/∂x there, for the exponential integrator. `displacement` is
the vector from the trap's equilibrium point to the sphere's centre and `kind` the sphere's optical kind. A new model is
such a triple and one line of `TRAP_TERMS`; of a curve, a row of `CURVES` makes two.
"""

import functools
from typing import NamedTuple

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.keyframes import Piece, find_key_from, row_at, sampled_value
from otwarp.kernels.core.packed import beside, point_of, power_of
from otwarp.kernels.core.reads import vec4_of, vec4i_of
from otwarp.kernels.core.step_constants import Glide, TrapConstants
from otwarp.kernels.core.table_data import GridLevel
from otwarp.kernels.core.types import ControlData, TrapData, world_row
from otwarp.kernels.optics.exact import exact_force_term
from otwarp.kernels.optics.force_table import blend_weight, table_stiffness_term, table_term
from otwarp.kernels.optics.trap_laws import (
    CURVES,
    beam_frame,
    harmonic_isotropic,
    harmonic_isotropic_stiffness,
    harmonic_split,
    harmonic_split_stiffness,
    isotropic_stiffness_term,
    isotropic_term,
    prepare_law,
    split_stiffness_term,
    split_term,
)


class TrapTerm(NamedTuple):
    """A force model: the key stored in `TrapData.model`, and its three functions."""

    key: int
    prepare: wp.Function
    force: wp.Function
    stiffness: wp.Function


@wp.func
def prepare_table(traps: TrapData, world: int, trap: int, radius: float, kind: int) -> TrapConstants:
    """Beam's frame, and the force table of this beam and the sphere's optical kind."""
    law = beam_frame(traps, trap)
    nodes = vec4i_of(traps.near_nodes, trap, kind)
    grid = vec4_of(traps.near_grid, trap, kind)
    law.table = nodes[0]
    law.finest = GridLevel(nodes[1], nodes[2], grid[0], grid[1], grid[2])
    law.equilibrium = grid[3]
    return law


def tabulated_term(interpolation: str, layers: int, upright: bool) -> wp.Function:
    """The force of a table, with z measured from the focus along the beam.

    Args:
        interpolation, layers: As `table_term`.
        upright: The beam's frame is the world's.
    """
    force_at = table_term(interpolation, layers)

    @wp.func
    def tabulated(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
        """Force [pN per mW] in world axes: the displacement [µm] turned into the beam's frame, the force back."""
        z = wp.dot(displacement, law.axis) + law.equilibrium
        x = wp.dot(displacement, law.side)
        y = wp.dot(displacement, law.up)
        f = force_at(traps.tables, law.table, law.finest, x, y, z)
        return f[0] * law.side + f[1] * law.up + f[2] * law.axis

    @wp.func
    def tabulated_upright(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
        """Force [pN per mW] where the beam's frame is the world's: a turn costs a third of a bilinear table."""
        z = displacement[2] + law.equilibrium
        return force_at(traps.tables, law.table, law.finest, displacement[0], displacement[1], z)

    return tabulated_upright if upright else tabulated


def tabulated_stiffness_term(interpolation: str, layers: int) -> wp.Function:
    """The stiffness of a table, in world axes; arguments as `table_term`."""
    stiffness_at = table_stiffness_term(interpolation, layers)

    @wp.func
    def tabulated_stiffness(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.mat33:
        """Stiffness [pN/µm per mW] in world axes, turned from the beam's frame."""
        frame = wp.matrix_from_rows(law.side, law.up, law.axis)
        place = frame * displacement + wp.vec3(0.0, 0.0, law.equilibrium)
        k = stiffness_at(traps.tables, law.table, place)
        return wp.transpose(frame) * k * frame

    return tabulated_stiffness


@functools.lru_cache(maxsize=16)
def exact_term(orders: int, nodes: int, shared: bool) -> wp.Function:
    """The exact force of the trap's beam on the sphere's kind, in float64; it ends as the tables do.

    Args:
        orders, nodes, shared: As `exact_force_term`.
    """
    force_at = exact_force_term(orders, nodes, shared)

    @wp.func
    def exact(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
        """Force [pN per mW] in world axes from Q in the beam's frame; 0 from the cutoff of the pair's table on."""
        z = wp.dot(displacement, law.axis) + law.equilibrium
        x = wp.dot(displacement, law.side)
        y = wp.dot(displacement, law.up)
        cutoff = traps.tables.level[traps.tables.level_start[law.table + 1] - 1].radius
        d2 = x * x + y * y + z * z
        force = wp.vec3(0.0)
        if d2 < cutoff * cutoff:
            q = force_at(traps.exact[law.table], wp.vec3d(wp.float64(x), wp.float64(y), wp.float64(z)))
            w = traps.exact_scale[law.table] * (1.0 - blend_weight(d2, cutoff))
            force = w * (wp.float32(q[0]) * law.side + wp.float32(q[1]) * law.up + wp.float32(q[2]) * law.axis)
        return force

    return exact


def curve_terms(name: str, key: int, ratio: wp.Function, curvature: wp.Function) -> dict[str, TrapTerm]:
    """Models of an authored curve by name: of one in all directions, and of one across and one along the beam.

    Args:
        key: Of the first; the second has the next.
        ratio, curvature: As `piecewise_ratio` and `piecewise_curvature`, in arguments and units.
    """
    one, two = (prepare_law(branches=True, split=split) for split in (False, True))
    return {
        f"{name}_isotropic": TrapTerm(key, one, isotropic_term(ratio), isotropic_stiffness_term(ratio, curvature)),
        f"{name}_split": TrapTerm(key + 1, two, split_term(ratio), split_stiffness_term(ratio, curvature)),
    }


LAYER_NAMES = {1: "", 2: "_polarized", 3: "_vortex"}
"""What the key of a table's term says about its layers."""

TABLE_KEY = 10
"""First key of the tabulated models."""


def table_name(interpolation: str, layers: int, upright: bool) -> str:
    """Name of a tabulated model; `upright` where the frame of the beam is the world's."""
    return f"table_{interpolation}{LAYER_NAMES[layers]}{'_upright' if upright else ''}"


TRAP_TERMS: dict[str, TrapTerm] = {
    "harmonic_isotropic": TrapTerm(
        0, prepare_law(branches=False, split=False), harmonic_isotropic, harmonic_isotropic_stiffness
    ),
    "harmonic_split": TrapTerm(1, prepare_law(branches=False, split=True), harmonic_split, harmonic_split_stiffness),
    **{name: term for curve, row in CURVES.items() for name, term in curve_terms(curve, *row).items()},
    **{
        table_name(interpolation, layers, upright): TrapTerm(
            TABLE_KEY + 6 * cubic + 2 * layers + upright,
            prepare_table,
            tabulated_term(interpolation, layers, upright),
            tabulated_stiffness_term(interpolation, layers),
        )
        for cubic, interpolation in enumerate(("bilinear", "bicubic"))
        for layers in LAYER_NAMES
        for upright in (False, True)
    },
}
"""Force models by name."""

AUTHORED = tuple(dict.fromkeys(name.rpartition("_")[0] for name in TRAP_TERMS if not name.startswith("table")))
"""Models that follow authored curves, as `ot:trap:model` calls them."""

EXACT_KEY = 40
"""First key of the exact models, whose terms depend on the room their spheres and reach need."""


def exact_name(orders: int, nodes: int, interpolation: str, layers: int, shared: bool) -> str:
    """Name of the exact model with these capacities, `shared` on a GPU; the rest describes the tables beside it."""
    return f"exact_{orders}_{nodes}_{interpolation}_{layers}{'_shared' if shared else ''}"


def trap_term(name: str) -> TrapTerm:
    """The model of this name: of `TRAP_TERMS`, or the exact one by `exact_name`.

    An exact force has a table beside it, which knows how far it reaches and how stiff it is.
    """
    if name.startswith("exact_"):
        orders, nodes, interpolation, layers, *shared = name.split("_")[1:]
        key = EXACT_KEY + 3 * (interpolation == "bicubic") + int(layers) - 1
        stiffness = tabulated_stiffness_term(interpolation, int(layers))
        return TrapTerm(key, prepare_table, exact_term(int(orders), int(nodes), bool(shared)), stiffness)
    return TRAP_TERMS[name]


def trap_force_term(models: tuple[str, ...]) -> TrapTerm:
    """The functions for the models a scene uses: those of the only one, or a branch on the trap's model."""
    head = trap_term(models[0])
    if len(models) == 1:
        return head
    rest = trap_force_term(models[1:])
    key, prepare_head, force_head, stiffness_head = head
    _, prepare_rest, force_rest, stiffness_rest = rest

    @wp.func
    def prepare(traps: TrapData, world: int, trap: int, radius: float, kind: int) -> TrapConstants:
        """Constants of the law of this model, or of one of the rest, by the trap's key."""
        law = TrapConstants()
        if traps.model[trap] == wp.static(key):
            law = prepare_head(traps, world, trap, radius, kind)
        else:
            law = prepare_rest(traps, world, trap, radius, kind)
        return law

    @wp.func
    def force(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.vec3:
        """Force [pN per mW] of this model, or of one of the rest, by the law's key."""
        f = wp.vec3(0.0)
        if law.model == wp.static(key):
            f = force_head(traps, law, displacement)
        else:
            f = force_rest(traps, law, displacement)
        return f

    @wp.func
    def stiffness(traps: TrapData, law: TrapConstants, displacement: wp.vec3) -> wp.mat33:
        """Stiffness [pN/µm per mW] of this model, or of one of the rest, by the law's key."""
        k = wp.mat33(0.0)
        if law.model == wp.static(key):
            k = stiffness_head(traps, law, displacement)
        else:
            k = stiffness_rest(traps, law, displacement)
        return k

    return TrapTerm(key, prepare, force, stiffness)


@wp.func
def commanded_still(traps: TrapData, control: ControlData, world: int, trap: int, time: wp.float64) -> wp.vec4:
    """Commanded focus [µm] and power [mW] of a trap that only the control moves."""
    p = control.trap_position[world_row(control.trap_position.shape[0], world), trap]
    return beside(p, control.trap_power[world_row(control.trap_power.shape[0], world), trap])


@wp.func
def glide_of(control: ControlData, world: int, trap: int) -> Glide:
    """How the focus of a trap is commanded to go on."""
    return Glide(control.trap_velocity[world, trap], control.trap_since[world])


@wp.func
def glided(glide: Glide, command: wp.vec4, time: wp.float64) -> wp.vec4:
    """A command with the focus [µm] as far as its velocity has taken it at `time` [s]."""
    way = wp.float32(time - glide.since) * glide.velocity
    return beside(point_of(command) + way, power_of(command))


@wp.func
def anchored(law: TrapConstants, command: wp.vec4) -> wp.vec4:
    """Equilibrium point [µm] and power [mW] of a trap from its focus [µm] and power."""
    anchor = point_of(command) + law.equilibrium * law.axis
    return beside(anchor, power_of(command))


@wp.func
def with_value(command: wp.vec4, follow: int, value: wp.vec4) -> wp.vec4:
    """A command with the focus [µm] (`follow` bit 0) and power [mW] (bit 1) of a sampled value."""
    result = command
    if (follow & 1) != 0:
        result = beside(point_of(value), power_of(result))
    if (follow & 2) != 0:
        result = beside(point_of(result), power_of(value))
    return result


@wp.func
def followed(
    command: wp.vec4, follow: int, times: wp.array(dtype=wp.float64), values: wp.array(dtype=wp.vec4), first: int,
    last: int, time: wp.float64,
) -> wp.vec4:  # fmt: skip
    """A command with focus [µm] (`follow` bit 0) and power [mW] (bit 1) from the samples `first` to `last`."""
    if follow != 0 and last > first:
        command = with_value(command, follow, sampled_value(times, values, first, last, time))
    return command


@wp.func
def commanded_animated(traps: TrapData, control: ControlData, world: int, trap: int, time: wp.float64) -> wp.vec4:
    """Commanded focus [µm] and power [mW] of a trap, from the scene's key frames where `follow` says so."""
    command = commanded_still(traps, control, world, trap, time)
    first = traps.key_start[trap]
    last = traps.key_start[trap + 1] - 1
    return followed(command, control.follow[trap], traps.key_time, traps.key_value, first, last, time)


@wp.func
def commanded_by_step(traps: TrapData, control: ControlData, world: int, trap: int, time: wp.float64) -> wp.vec4:
    """The same at the `time` [s] of a step whose key frames have been looked up for all worlds."""
    command = commanded_still(traps, control, world, trap, time)
    follow = control.follow[trap]
    if follow != 0 and traps.key_start[trap + 1] - traps.key_start[trap] > 1:
        command = with_value(command, follow, traps.step_value[row_at(traps.step_times, time), trap])
    return command


@wp.func
def commanded_staged(traps: TrapData, control: ControlData, world: int, trap: int, time: wp.float64) -> wp.vec4:
    """Focus [µm] and power [mW] as a stage at `time` [s] sees them, where commands vary within steps."""
    command = commanded_still(traps, control, world, trap, time)
    first = traps.stage_start[trap]
    last = traps.stage_start[trap + 1] - 1
    return followed(command, control.follow[trap], traps.stage_time, traps.stage_value, first, last, time)


@wp.func
def piece_at(
    times: wp.array(dtype=wp.float64), values: wp.array(dtype=wp.vec4), follow: int, key: int, first: int, last: int,
    time: wp.float64,
) -> Piece:  # fmt: skip
    """The piece of the samples `first` to `last` at `time` [s], looked for from `key` on; `follow` as in `followed`."""
    piece = Piece()
    piece.since = wp.float64(-wp.inf)
    piece.until = wp.float64(wp.inf)
    if follow != 0 and last > first:
        piece.follow = follow
        piece.key = find_key_from(times, key, first, last, time)
        piece.origin = times[piece.key]
        end = times[piece.key + 1]
        piece.rate = wp.float64(1.0) / (end - piece.origin)
        if piece.key != first:
            piece.since = piece.origin
        if piece.key + 1 != last:
            piece.until = end
        piece.start = values[piece.key]
        piece.end = values[piece.key + 1]
    return piece


@wp.func
def on_piece(piece: Piece, still: wp.vec4, time: wp.float64) -> wp.vec4:
    """Focus [µm] and power [mW] at a `time` [s] of the piece, as `still` where it does not follow."""
    w = wp.clamp(wp.float32((time - piece.origin) * piece.rate), 0.0, 1.0)
    value = (1.0 - w) * piece.start + w * piece.end
    return with_value(still, piece.follow, value)


def piece_terms(f: Features) -> tuple[wp.Function, wp.Function]:
    """Commands that are not looked up in every step.

    `(traps, control, trap, piece, time) -> Piece`, the one of a trap at `time`, and `(traps, control, trap, piece,
    still, time) -> vec4`, focus [µm] and power [mW] as `commanded_animated`, or where commands vary within steps as
    `commanded_staged`, with `still` = `commanded_still`; of another piece than the one given only where that does not
    hold `time`.
    """

    @wp.func
    def next_piece(traps: TrapData, control: ControlData, trap: int, piece: Piece, time: wp.float64) -> Piece:
        """The piece of a trap at `time` [s], looked for from the given one on."""
        follow = control.follow[trap]
        if wp.static(f.leaps):
            first, last = traps.stage_start[trap], traps.stage_start[trap + 1] - 1
            found = piece_at(traps.stage_time, traps.stage_value, follow, piece.key, first, last, time)
        else:
            first, last = traps.key_start[trap], traps.key_start[trap + 1] - 1
            found = piece_at(traps.key_time, traps.key_value, follow, piece.key, first, last, time)
        return found

    @wp.func
    def piece_of(traps: TrapData, control: ControlData, trap: int, piece: Piece, time: wp.float64) -> Piece:
        """The piece at `time` [s]: the given one, or a new one where that ends before."""
        if time >= piece.since and time < piece.until:
            return piece
        return next_piece(traps, control, trap, piece, time)

    @wp.func
    def commanded_by_piece(
        traps: TrapData, control: ControlData, trap: int, piece: Piece, still: wp.vec4, time: wp.float64
    ) -> wp.vec4:
        """Commanded focus [µm] and power [mW] at `time` [s]; two returns, for a copy of a piece costs a third of it."""
        if time >= piece.since and time < piece.until:
            return on_piece(piece, still, time)
        return on_piece(next_piece(traps, control, trap, piece, time), still, time)

    return piece_of, commanded_by_piece


@wp.func
def limited_focus(traps: TrapData, world: int, trap: int, now: wp.vec3, wanted: wp.vec3, dt: float) -> wp.vec3:
    """Focus [µm] after one step of `dt` [s] towards `wanted`, no faster than the trap's speed limit [µm/s]."""
    limit = traps.speed_limit[world_row(traps.speed_limit.shape[0], world), trap] * dt
    way = wanted - now
    distance = wp.length(way)
    result = wanted
    if distance > limit:
        result = now + (limit / distance) * way
    return result
