"""What the traps do to a body: where each of them is, whether it reaches, and the wrench it exerts."""

import warp as wp

from otwarp.kernels.core.features import KEPT_AIMS, Features
from otwarp.kernels.core.packed import point_of, radius_of
from otwarp.kernels.core.reads import index_at, vec4_at
from otwarp.kernels.core.rotation import rotation_matrix
from otwarp.kernels.core.step_constants import RigidConstants
from otwarp.kernels.core.team import team_of
from otwarp.kernels.core.types import Aim, ControlData, ModelData, Pose, StateData, Wrench, mat66
from otwarp.kernels.cpu.rigid_block import AIMS, SPHERES
from otwarp.kernels.cpu.table_block import address_of_aims, table_wrench_term
from otwarp.kernels.optics.aims import aim_term, kept_aim
from otwarp.kernels.optics.near_traps import listed_wrench_term
from otwarp.kernels.optics.traps import (
    LAYER_NAMES,
    glide_of,
    glided,
    table_name,
    trap_force_term,
)


def pull_term(f: Features) -> wp.Function:
    """`(model, world, aim, trap, place, radius, element, force) -> force` with what one trap adds on a sphere [pN]."""
    _, prepare, trap_force, _ = trap_force_term(f.trap_models)

    @wp.func
    def pulled(
        model: ModelData, world: int, aim: Aim, trap: int, place: wp.vec3, radius: float, element: int, force: wp.vec3
    ) -> wp.vec3:
        """`force` [pN], and that of a trap on trapped sphere `element` at `place` [µm] where the trap reaches it."""
        away = place - aim.anchor
        # left at once, and written so that a NaN is out of reach
        if not wp.length_sq(away) < aim.reach2:
            return force
        law = prepare(model.traps, world, trap, radius, index_at(model.body.trapped_kind, element))
        return force + aim.power * trap_force(model.traps, law, away)

    return pulled


def blocked_table(f: Features) -> tuple[int, bool] | None:
    """Layers of the tables, and whether all beams are upright, where a CPU has their forces from `table_block`."""
    if not f.lanes or len(f.trap_models) != 1:
        return None
    names = {
        table_name("bilinear", layers, upright): (layers, upright)
        for layers in LAYER_NAMES
        for upright in (False, True)
    }
    return names.get(f.trap_models[0])


def blocked_wrench_term(f: Features, layers: int, upright: bool) -> wp.Function:
    """`trap_wrench_term` of bilinear tables in the lanes of a CPU."""
    aim_at = aim_term(f)
    aims_are_kept = f.keeps_aims and f.still_traps
    table_wrench = table_wrench_term(f.traps, layers, upright)

    @wp.func
    def blocked_wrench(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> Wrench:  # fmt: skip
        """Force [pN] and torque [pN·µm] of all traps by `table_block`, from aims that are kept or made now."""
        at = body.kept + wp.static(wp.uint64(4 * AIMS))
        if wp.static(not aims_are_kept):
            aims = wp.zeros(shape=(wp.static(f.traps),), dtype=Aim)
            traps = int(wp.static(f.traps))
            for trap in range(traps):
                aims[trap] = aim_at(model, control, state, world, b, pose, trap, time)
            at = address_of_aims(aims)
        both = table_wrench(
            body.kept + wp.static(wp.uint64(4 * SPHERES)),
            at,
            pose.position,
            rotation_matrix(pose.rotation),
            model.body.trapped,
            model.body.trapped_kind,
            model.body.trapped_start[b],
            model.body.trapped_start[b + 1],
            model.traps.axis,
            model.traps.side,
            model.traps.near_nodes,
            model.traps.near_grid,
            model.traps.tables.node,
            model.traps.tables.level_start,
            model.traps.tables.level,
        )
        return Wrench(wp.vec3(both[0], both[1], both[2]), wp.vec3(both[3], both[4], both[5]))

    return blocked_wrench


def place_aims_term(f: Features) -> wp.Function:
    """`(model, control, state, world, b, pose, time, aims)`: all traps' aims, another in each thread of a team."""
    aim_at, traps = aim_term(f), f.traps
    size_of, lane_of, value_of = team_of(f).size, team_of(f).lane, team_of(f).value

    @wp.func
    def told(aim: Aim, lane: int) -> Aim:
        """The aim that a thread of the team has made [µm, mW, µm²]."""
        anchor = aim.anchor
        anchor = wp.vec3(value_of(anchor[0], lane), value_of(anchor[1], lane), value_of(anchor[2], lane))
        return Aim(anchor, value_of(aim.power, lane), value_of(aim.reach2, lane))

    @wp.func
    def place_aims(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, pose: Pose, time: wp.float64,
        aims: wp.array(dtype=Aim),
    ):  # fmt: skip
        """Fill `aims`, as `aim_at` gives them at `time` [s] for a body at `pose` [µm]."""
        many = int(wp.static(traps))
        if wp.static(f.team > 1):
            for first in range(0, many, size_of()):
                aim = aim_at(model, control, state, world, b, pose, wp.min(first + lane_of(), many - 1), time)
                for k in range(wp.min(size_of(), many - first)):
                    aims[first + k] = told(aim, k)
        else:
            for trap in range(many):
                aims[trap] = aim_at(model, control, state, world, b, pose, trap, time)

    return place_aims


def pull_of_kept_term(f: Features) -> wp.Function:
    """`(model, control, body, world, place, radius, element, time) -> force` of traps at rest, or gliding."""
    pulled = pull_term(f)

    @wp.func
    def pull_of_kept(
        model: ModelData, control: ControlData, body: RigidConstants, world: int, place: wp.vec3, radius: float,
        element: int, time: wp.float64,
    ) -> wp.vec3:  # fmt: skip
        """Force [pN] on a trapped sphere at `place` [µm] of traps kept: an array of aims would lie in memory."""
        force = wp.vec3(0.0)
        for trap in range(wp.static(f.traps)):
            aim = kept_aim(body, trap)
            if wp.static(f.gliding_traps):
                aim.anchor = point_of(glided(glide_of(control, world, trap), body.aims[trap], time))
            force = pulled(model, world, aim, trap, place, radius, element, force)
        return force

    return pull_of_kept


def pull_of_aims_term(f: Features) -> wp.Function:
    """`(model, aims, world, place, radius, element) -> force` of traps that may move."""
    pulled, unrolled = pull_term(f), f.traps <= KEPT_AIMS

    @wp.func
    def pull_of_aims(
        model: ModelData, aims: wp.array(dtype=Aim), world: int, place: wp.vec3, radius: float, element: int
    ) -> wp.vec3:
        """Force [pN] on a trapped sphere at `place` [µm] of traps that are where `aims` say."""
        force = wp.vec3(0.0)
        if wp.static(unrolled):
            for trap in range(wp.static(f.traps)):
                force = pulled(model, world, aims[trap], trap, place, radius, element, force)
        else:
            many = int(wp.static(f.traps))
            for trap in range(many):
                force = pulled(model, world, aims[trap], trap, place, radius, element, force)
        return force

    return pull_of_aims


def trap_wrench_term(f: Features) -> wp.Function:
    """`(model, control, state, body, world, b, pose, time) -> Wrench` of all traps (the sum of MSDM, eq. 2)."""
    blocked = blocked_table(f)
    if blocked is not None:
        return blocked_wrench_term(f, *blocked)
    if f.listed:
        return listed_wrench_term(f)
    aims_are_kept = f.keeps_aims
    place_aims, pull_of_kept, pull_of_aims = place_aims_term(f), pull_of_kept_term(f), pull_of_aims_term(f)
    size_of, lane_of, value_of = team_of(f).size, team_of(f).lane, team_of(f).value

    @wp.func
    def trap_wrench(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> Wrench:  # fmt: skip
        """Force [pN] and torque [pN·µm] of all traps, sphere by sphere: a sphere takes longer to place than a trap.

        Each thread of a team aims other traps, and sees to other spheres; all add up all of them in their order.
        """
        total = Wrench(wp.vec3(0.0), wp.vec3(0.0))
        if wp.static(not aims_are_kept):
            aims = wp.zeros(shape=(wp.static(f.traps),), dtype=Aim)
            place_aims(model, control, state, world, b, pose, time, aims)
        turn = rotation_matrix(pose.rotation)
        start = index_at(model.body.trapped_start, b)
        end = index_at(model.body.trapped_start, b + 1)
        for first in range(start, end, size_of()):
            element = first
            if wp.static(f.team > 1):
                element = wp.min(first + lane_of(), end - 1)
            sphere = vec4_at(model.body.trapped, element)
            arm = turn * point_of(sphere)
            place = pose.position + arm
            if wp.static(aims_are_kept):
                force = pull_of_kept(model, control, body, world, place, radius_of(sphere), element, time)
            else:
                force = pull_of_aims(model, aims, world, place, radius_of(sphere), element)
            if wp.static(f.team > 1):
                torque = wp.cross(arm, force)
                for k in range(wp.min(size_of(), end - first)):
                    total.force += wp.vec3(value_of(force[0], k), value_of(force[1], k), value_of(force[2], k))
                    total.torque += wp.vec3(value_of(torque[0], k), value_of(torque[1], k), value_of(torque[2], k))
            else:
                total.force += force
                total.torque += wp.cross(arm, force)
        return total

    return trap_wrench


@wp.func
def cross_matrix(a: wp.vec3) -> wp.mat33:
    """Matrix [a]× of the cross product, [a]× v = a × v."""
    return wp.mat33(0.0, -a[2], a[1], a[2], 0.0, -a[0], -a[1], a[0], 0.0)


def wrench_stiffness_term(f: Features) -> wp.Function:
    """`(model, control, state, world, b, pose, time) -> (6, 6)` symmetric part of −∂(F, T)/∂(x, θ) by the traps.

    Of a sphere at the arm a that feels the force F and the stiffness K: Jᵀ K J with J = (1, −[a]×), and of the force
    turned along with the arm (a·F) 1 − ½(a Fᵀ + F aᵀ) on the rotations.
    """
    _, prepare, trap_force, trap_stiffness = trap_force_term(f.trap_models)
    aim_at = aim_term(f)

    @wp.func
    def add_sphere(total: mat66, arm: wp.vec3, force: wp.vec3, k: wp.mat33) -> mat66:
        """`total` plus the 6×6 stiffness [pN/µm, pN, pN·µm] of one sphere in one trap."""
        lever = cross_matrix(arm)
        mixed = -k * lever
        turning = -lever * k * lever
        turning += wp.dot(arm, force) * wp.identity(n=3, dtype=float)
        turning -= 0.5 * (wp.outer(arm, force) + wp.outer(force, arm))
        for i in range(3):
            for j in range(3):
                total[i, j] += k[i, j]
                total[i, j + 3] += mixed[i, j]
                total[j + 3, i] += mixed[i, j]
                total[i + 3, j + 3] += turning[i, j]
        return total

    @wp.func
    def wrench_stiffness(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, pose: Pose, time: wp.float64
    ) -> mat66:
        """Sum of the 6×6 stiffnesses [pN/µm, pN, pN·µm] over traps and trapped spheres, world axes."""
        total = mat66(0.0)
        traps = int(wp.static(f.traps))
        for trap in range(traps):
            aim = aim_at(model, control, state, world, b, pose, trap, time)
            for element in range(model.body.trapped_start[b], model.body.trapped_start[b + 1]):
                sphere = model.body.trapped[element]
                arm = wp.quat_rotate(pose.rotation, point_of(sphere))
                away = pose.position + arm - aim.anchor
                if wp.length_sq(away) < aim.reach2:
                    law = prepare(model.traps, world, trap, radius_of(sphere), model.body.trapped_kind[element])
                    force = aim.power * trap_force(model.traps, law, away)
                    total = add_sphere(total, arm, force, aim.power * trap_stiffness(model.traps, law, away))
        return total

    return wrench_stiffness
