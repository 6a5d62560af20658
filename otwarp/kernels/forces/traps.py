"""The optical force of all traps on a lone sphere; that on a rigid body is `optics.trap_wrench`."""

import warp as wp

from otwarp.kernels.core.features import FEW_TRAPS, Features
from otwarp.kernels.core.keyframes import Piece
from otwarp.kernels.core.packed import point_of, power_of
from otwarp.kernels.core.periodic import nearest
from otwarp.kernels.core.step_constants import BeadConstants, Glide, TrapConstants
from otwarp.kernels.core.types import ControlData, ModelData, StateData
from otwarp.kernels.forces.force import Term
from otwarp.kernels.forces.zeros import ZEROS
from otwarp.kernels.optics.aims import reach_term
from otwarp.kernels.optics.trap_command import anchor_of, piece_command_term, trap_command_term
from otwarp.kernels.optics.traps import AUTHORED, anchored, glided, piece_terms, trap_force_term


def trap_kinds(f: Features) -> list[Term]:
    """A term per model of trap laws, and which of them some trap follows."""
    kinds = [*((k, f"{k} trap") for k in AUTHORED), ("table", "tabulated trap"), ("exact", "exact optical force")]
    return [(name, any(k in m for m in f.trap_models), "a trap uses it", "no trap uses it") for k, name in kinds]


@wp.func
def is_trapped(model: ModelData, b: int) -> bool:
    """Whether traps act on some sphere of body b."""
    return model.body.trapped_start[b + 1] > model.body.trapped_start[b]


def few_command_term(f: Features) -> wp.Function:
    """`(model, control, state, world, trap, piece, glide, still, time) -> vec4(focus, power)` of a stage."""
    if f.moving_traps:
        return piece_command_term(f)
    trap_command = trap_command_term(f, stage=True)

    @wp.func
    def gliding(
        model: ModelData, control: ControlData, state: StateData, world: int, trap: int, piece: Piece, glide: Glide,
        still: wp.vec4, time: wp.float64,
    ) -> wp.vec4:  # fmt: skip
        """Focus [µm] and power [mW] of a trap that follows no samples, from where it was when it began to glide."""
        return glided(glide, still, time)

    @wp.func
    def unsampled(
        model: ModelData, control: ControlData, state: StateData, world: int, trap: int, piece: Piece, glide: Glide,
        still: wp.vec4, time: wp.float64,
    ) -> wp.vec4:  # fmt: skip
        """Focus [µm] and power [mW] of a trap that follows no samples."""
        return trap_command(model, control, state, world, trap, time)

    return gliding if f.gliding_traps and not f.speed_limits else unsampled


def next_pieces_term(f: Features) -> wp.Function:
    """`(model, control, bead, time) -> BeadConstants` with the pieces of its traps' commands at `time`."""
    piece_of, _ = piece_terms(f)

    @wp.func
    def next_pieces(model: ModelData, control: ControlData, bead: BeadConstants, time: wp.float64) -> BeadConstants:
        """The constants of a step from `time` [s] on."""
        out = bead
        out.first_piece = piece_of(model.traps, control, 0, bead.first_piece, time)
        if wp.static(f.traps == FEW_TRAPS):
            out.second_piece = piece_of(model.traps, control, 1, bead.second_piece, time)
        return out

    return next_pieces


def takes_pieces(f: Features) -> bool:
    """Whether a lone sphere keeps the pieces of its traps' commands over a launch."""
    return f.moving_traps and bool(f.trap_models) and f.traps <= FEW_TRAPS


def one_of_few_term(f: Features, what: str) -> wp.Function:
    """`(model, law, anchor, position)`: `force` or `stiffness` of one trap whose constants are known."""
    value_at, kind = getattr(trap_force_term(f.trap_models), what), ZEROS[what][0]

    @wp.func
    def one_of_few(model: ModelData, law: TrapConstants, anchor: wp.vec4, position: wp.vec3) -> kind:
        """Power times the law of one prepared trap at `position` [µm]: force [pN] or stiffness [pN/µm]."""
        away = position - point_of(anchor)
        if wp.static(f.periodic):
            away = nearest(model.period, away)
        return power_of(anchor) * value_at(model.traps, law, away)

    return one_of_few


def sum_over_traps_term(f: Features, what: str) -> wp.Function:
    """`(model, control, state, bead, world, b, position, time)` → sum over the traps of their `force` or `stiffness`.

    Args:
        what: Name of the function of `TrapTerm`, [pN] or [pN/µm] once the power is in.
    """
    term = trap_force_term(f.trap_models)
    prepare, value_at = term.prepare, getattr(term, what)
    kind, nothing = ZEROS[what]
    trap_command = trap_command_term(f, stage=True)
    few_command, one_of_few = few_command_term(f), one_of_few_term(f, what)
    reach_of = reach_term(f)

    @wp.func
    def of_few(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> kind:  # fmt: skip
        """Sum [pN or pN/µm] over one or two traps whose constants `bead` holds."""
        anchor = bead.first_anchor
        if wp.static(not f.still_traps):
            glide, kept = bead.first_glide, bead.first_anchor
            now = few_command(model, control, state, world, 0, bead.first_piece, glide, kept, time)
            anchor = anchored(bead.first, now)
        total = one_of_few(model, bead.first, anchor, position)
        if wp.static(f.traps == FEW_TRAPS):
            other = bead.second_anchor
            if wp.static(not f.still_traps):
                glide2, kept2 = bead.second_glide, bead.second_anchor
                then = few_command(model, control, state, world, 1, bead.second_piece, glide2, kept2, time)
                other = anchored(bead.second, then)
            total += one_of_few(model, bead.second, other, position)
        return total

    @wp.func
    def of_many(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> kind:  # fmt: skip
        """Sum [pN or pN/µm] over the traps within whose reach the sphere is."""
        total = nothing()
        traps = int(wp.static(f.traps))
        for trap in range(traps):
            now = trap_command(model, control, state, world, trap, time)
            away = position - anchor_of(model, trap, now)
            if wp.static(f.periodic):
                away = nearest(model.period, away)
            reach = reach_of(model, world, trap, bead.radius)
            if wp.length_sq(away) < reach * reach:
                law = prepare(model.traps, world, trap, bead.radius, bead.kind)
                total += power_of(now) * value_at(model.traps, law, away)
        return total

    return of_few if f.traps <= FEW_TRAPS else of_many


def traps_on_sphere(f: Features, what: str) -> wp.Function:
    """`(model, control, state, bead, world, b, position, time)` → `force` or `stiffness`, as `sum_over_traps_term`."""
    total = sum_over_traps_term(f, what)
    kind, nothing = ZEROS[what]

    @wp.func
    def of_traps(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> kind:  # fmt: skip
        """Sum over the traps [pN or pN/µm]; 0 on a sphere that traps do not act on."""
        value = nothing()
        if bead.trapped != 0:
            value = total(model, control, state, bead, world, b, position, time)
        return value

    return of_traps
