"""Which traps can reach which spheres of a robot: listed once, and again when it has moved far enough to matter.

A trap of finite reach holds one sphere of a robot and is far from the others, whose distances cost as much as a force.
As the lists of neighbours of many bodies have a skin, a pair that is left out is beyond its reach by `SKIN` of it at
least, and `leeway` is how far points of the body may go until one could come into reach. A GPU keeps the list, and what
it knows of the traps, in rows of `thread_rows`.
"""

import warp as wp

from otwarp.kernels.core.features import KEPT_AIMS, Features
from otwarp.kernels.core.packed import beside, point_of, power_of, radius_of
from otwarp.kernels.core.reads import index_at, vec4_at
from otwarp.kernels.core.rotation import rotation_matrix
from otwarp.kernels.core.step_constants import RigidConstants
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData, Wrench, vec6
from otwarp.kernels.optics.aims import rest_aim_term
from otwarp.kernels.optics.escapes import gliding_way
from otwarp.kernels.optics.thread_rows import ROWS, number_of, put_row, row_of
from otwarp.kernels.optics.traps import glide_of, glided, trap_force_term

SKIN = wp.constant(0.25)
"""Of a reach by which pairs that are left out are beyond it: of a robot that is held, hundreds of steps away."""

SAFE = wp.constant(0.02)
"""Of a reach by which rounding may be off, at coordinates up to 10⁵ reaches."""

_REACHES, _PAIRS = wp.constant(KEPT_AIMS), wp.constant(KEPT_AIMS + 1)
"""Rows of the squared reaches, and of the first pair; the foci and powers of the traps come first."""

LISTED = wp.constant(ROWS - KEPT_AIMS - 1)
"""Pairs that there is room for: where more are near, all are looked at."""

_TRAPS = wp.constant(KEPT_AIMS)
"""A pair is known by its sphere's index among the trapped ones times this, and its trap's."""


@wp.func
def strayed(body: RigidConstants, move: vec6) -> RigidConstants:
    """The constants for a look after a move [µm, rad] within a step: without a list if it went beyond the leeway."""
    turn = wp.vec3(move[3], move[4], move[5])
    way = wp.length(wp.vec3(move[0], move[1], move[2])) + body.bound * wp.length(turn)
    # written so that a NaN has strayed
    if not way < body.leeway:
        body.listed = 0
    return body


def keep_aims_term(f: Features) -> wp.Function:
    """`(model, control, body, world, b)`: lay out where the traps are, or were when they began to glide."""
    rest_aim = rest_aim_term(f)

    @wp.func
    def keep_aims(model: ModelData, control: ControlData, body: RigidConstants, world: int, b: int):
        """Rows of equilibrium point [µm] and power [mW] of each trap, and of squared reaches [µm²]."""
        reaches = wp.vec4()
        for trap in range(wp.static(f.traps)):
            aim = rest_aim(model, control, world, b, trap)
            put_row(body.rows, trap, beside(aim.anchor, aim.power))
            reaches[trap] = aim.reach2
        put_row(body.rows, _REACHES, reaches)

    return keep_aims


def aim_now_term(f: Features) -> wp.Function:
    """`(control, body, world, trap, time) -> vec4(focus, power)` at a time."""

    @wp.func
    def aim_now(control: ControlData, body: RigidConstants, world: int, trap: int, time: wp.float64) -> wp.vec4:
        """Equilibrium point [µm] and power [mW] of a trap at `time` [s]."""
        row = row_of(body.rows, trap)
        if wp.static(f.gliding_traps):
            row = glided(glide_of(control, world, trap), row, time)
        return row

    return aim_now


def list_pairs_term(f: Features) -> wp.Function:
    """`(model, control, body, world, b, pose, time) -> (listed, pairs, leeway)`: a list for this pose and time."""
    aim_now = aim_now_term(f)

    @wp.func
    def list_pairs(
        model: ModelData, control: ControlData, body: RigidConstants, world: int, b: int, pose: Pose, time: wp.float64
    ) -> tuple[int, int, float]:
        """Whether all pairs near are listed [0, 1], how many they are, and how far points of the body may go until
        they are to be listed anew [µm]."""
        turn = rotation_matrix(pose.rotation)
        pairs = int(0)
        leeway = float(wp.inf)
        traps = int(wp.static(f.traps))
        for element in range(index_at(model.body.trapped_start, b), index_at(model.body.trapped_start, b + 1)):
            sphere = vec4_at(model.body.trapped, element)
            place = pose.position + turn * point_of(sphere)
            for trap in range(traps):
                reach = wp.sqrt(number_of(body.rows, _REACHES, trap))
                left = wp.length(place - point_of(aim_now(control, body, world, trap, time))) - reach
                # a dark trap reaches nothing as long as it is dark
                if reach != 0.0:
                    # written so that a NaN is near
                    if left > SKIN * reach:
                        leeway = wp.min(leeway, left - SAFE * reach)
                    else:
                        if pairs < LISTED:
                            pair = wp.cast(element * _TRAPS + trap, wp.float32)
                            put_row(body.rows, _PAIRS + pairs, wp.vec4(sphere[0], sphere[1], sphere[2], pair))
                        pairs += 1
        if wp.static(f.gliding_traps):
            # a look at the end of a step is one step ahead
            leeway -= gliding_way(model, control, world)
        return wp.where(pairs <= LISTED, 1, 0), pairs, leeway

    return list_pairs


def add_pair_term(f: Features) -> wp.Function:
    """`(model, control, body, world, position, time, arm, element, trap, total) -> total` with what a pair adds."""
    _, prepare, trap_force, _ = trap_force_term(f.trap_models)
    aim_now = aim_now_term(f)

    @wp.func
    def add_pair(
        model: ModelData, control: ControlData, body: RigidConstants, world: int, position: wp.vec3, time: wp.float64,
        arm: wp.vec3, element: int, trap: int, total: Wrench,
    ) -> Wrench:  # fmt: skip
        """`total` [pN, pN·µm], and the wrench of a trap on trapped sphere `element` at `arm` [µm] where it reaches."""
        # before the distance is known: what is read need not wait for that
        radius = radius_of(vec4_at(model.body.trapped, element))
        law = prepare(model.traps, world, trap, radius, index_at(model.body.trapped_kind, element))
        aim = aim_now(control, body, world, trap, time)
        away = position + arm - point_of(aim)
        # written so that a NaN is out of reach
        if wp.length_sq(away) < number_of(body.rows, _REACHES, trap):
            force = power_of(aim) * trap_force(model.traps, law, away)
            total.force += force
            total.torque += wp.cross(arm, force)
        return total

    return add_pair


def listed_wrench_term(f: Features) -> wp.Function:
    """`trap_wrench_term` of a robot with a list: over its pairs, sphere by sphere; or over all that there are."""
    add_pair = add_pair_term(f)

    @wp.func
    def listed_wrench(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> Wrench:  # fmt: skip
        """Force [pN] and torque [pN·µm] of all traps, in the order of `trap_wrench`."""
        total = Wrench(wp.vec3(0.0), wp.vec3(0.0))
        turn = rotation_matrix(pose.rotation)
        if body.listed != 0:
            for n in range(body.pairs):
                row = row_of(body.rows, _PAIRS + n)
                pair = wp.cast(row[3], wp.int32)
                arm = turn * point_of(row)
                total = add_pair(
                    model, control, body, world, pose.position, time, arm, pair // _TRAPS, pair % _TRAPS, total
                )  # fmt: skip
        else:
            traps = int(wp.static(f.traps))
            for element in range(index_at(model.body.trapped_start, b), index_at(model.body.trapped_start, b + 1)):
                far = turn * point_of(vec4_at(model.body.trapped, element))
                for trap in range(traps):
                    total = add_pair(model, control, body, world, pose.position, time, far, element, trap, total)
        return total

    return listed_wrench
