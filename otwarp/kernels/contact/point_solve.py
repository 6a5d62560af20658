"""The contact forces of a world whose bodies are each touched through one point: three unknowns a body.

The energy is that of `body_solve`. All forces on a lone sphere run through its centre, so that all contacts of a rigid
body that touches nothing but one lone sphere run through one point of it. Of all its moves that move this point by x,
it makes the one of least resistance, ½ xᵀA⁻¹x with the mobility A of the point: the point is all there is to be found,
and the force A⁻¹x at it moves the body. Few bodies make a matrix so small that it stays in registers.
"""

import warp as wp

from otwarp.kernels.contact.blocks import inverse_root
from otwarp.kernels.contact.body_solve import BALANCED, ROUNDS, WHOLE_ROUNDS, settling_team, turning_term
from otwarp.kernels.contact.contact import rigid_response
from otwarp.kernels.contact.contact_list import ContactList
from otwarp.kernels.contact.point_gather import column, gather_term, table
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.reads import mat66_at
from otwarp.kernels.core.roots import length_of, reciprocal_root
from otwarp.kernels.core.rotation import rotation_matrix
from otwarp.kernels.core.types import ModelData, mat66

_BITS = wp.constant(4)
"""Bits in which a partner is kept."""

_PARTNER = wp.constant(15)
"""Their mask: 1 + the number of a body, 0 for none."""

FIRST_SLACK = wp.constant(10.0)
"""What may be out of balance in the first of two stages, over that at the end of a step.

The places of the first stage serve to find the drift a second time and no more: an error e of theirs moves a body by
½·(step/relaxation time)·e, at most a tenth of e in steps that are chosen.
"""

DOUBT = wp.constant(10.0)
"""By so much an error may be larger than Newton's method lets expect."""

MANY = wp.constant(-1)
"""In place of partners: some body is touched through more than one point."""


def joined_term(f: Features) -> wp.Function:
    """`(model, partners, a, b) -> int`: partners once bodies a and b touch; b is −1 for an obstacle.

    1 + the number of the lone sphere that each rigid body touches, `_BITS` a body, 0 for bodies without; or `MANY`.
    """
    turning = turning_term(f)

    @wp.func
    def with_partner(partners: int, b: int, other: int) -> int:
        """The partners with sphere `other` as that of body b, or `MANY` if it has another one."""
        known = (partners >> (_BITS * b)) & _PARTNER
        result = partners | ((other + 1) << (_BITS * b))
        if known != 0 and known != other + 1:
            result = MANY
        return result

    @wp.func
    def joined(model: ModelData, partners: int, a: int, b: int) -> int:
        """The new partners; a rigid body that touches another one or an obstacle is not moved by one point."""
        result = partners
        if wp.static(f.rigid):
            if partners != MANY:
                own_turns = turning(model, a)
                other_turns = b >= 0 and turning(model, wp.max(b, 0))
                if own_turns and (b < 0 or other_turns):
                    result = MANY
                elif own_turns:
                    result = with_partner(partners, a, b)
                elif other_turns:
                    result = with_partner(partners, b, a)
        return result

    return joined


@wp.func
def point_mobility(mobility: mat66, rotation: wp.quat, arm: wp.vec3) -> wp.mat33:
    """What the point at `arm` [µm] of a rigid body moves per force there: B M Bᵀ with B = (1, −[arm]×), world axes.

    In the units of `mobility`, 1/µm or µm/pN.
    """
    a = wp.quat_rotate_inv(rotation, arm)
    m = mobility
    tt = wp.mat33(m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])
    rt = wp.mat33(m[3, 0], m[3, 1], m[3, 2], m[4, 0], m[4, 1], m[4, 2], m[5, 0], m[5, 1], m[5, 2])
    rr = wp.mat33(m[3, 3], m[3, 4], m[3, 5], m[4, 3], m[4, 4], m[4, 5], m[5, 3], m[5, 4], m[5, 5])
    lever = wp.skew(a)
    both = lever * rt
    turn = rotation_matrix(rotation)
    return turn * (tt - both - wp.transpose(both) - lever * rr * lever) * wp.transpose(turn)


@wp.func
def partner_of(partners: int, b: int) -> int:
    """Number of the lone sphere that body b touches, −1 for none."""
    return ((partners >> (_BITS * b)) & _PARTNER) - 1


def point_arm_term(f: Features) -> wp.Function:
    """`(model, position, b, partner) -> arm`: from a body's reference point to the point it is touched through."""

    @wp.func
    def point_arm(model: ModelData, position: wp.array(dtype=wp.vec3), b: int, partner: int) -> wp.vec3:
        """The arm [µm]; 0 without a partner."""
        arm = wp.vec3(0.0)
        if partner >= 0:
            arm = position[partner] - position[b]
            if wp.static(f.periodic):
                arm += image_shift(model.period, arm)
        return arm

    return point_arm


def solve_system_term(rows: int) -> wp.Function:
    """`(system, right) -> solution` of a symmetric positive definite matrix, given by its lower triangle."""

    @wp.func
    def solve_system(system: table(rows, rows), right: column(rows)) -> column(rows):
        """Cholesky's factor row by row, its diagonal inverted, and the solution by it."""
        for i in range(wp.static(rows)):
            rest = system[i, i]
            value = right[i]
            for j in range(i):
                entry = system[i, j]
                for k in range(j):
                    entry -= system[i, k] * system[j, k]
                entry *= system[j, j]
                rest -= entry * entry
                value -= entry * right[j]
                system[i, j] = entry
            root = reciprocal_root(rest)
            system[i, i] = root
            right[i] = root * value
        for i in range(wp.static(rows - 1), -1, -1):
            value = system[i, i] * right[i]
            right[i] = value
            for k in range(i):
                right[k] -= system[i, k] * value
        return right

    return solve_system


def point_drag_term(f: Features) -> wp.Function:
    """`(model, scale, rotation, b, arm) -> (drag, give)` of the point at `arm` of body b; `scale` = dt/η."""
    turning = turning_term(f)

    @wp.func
    def point_drag(model: ModelData, scale: float, rotation: wp.array(dtype=wp.quat), b: int, arm: wp.vec3):
        """Force there per move [pN/µm] of a step, and about the largest move per force [µm/pN]."""
        shape = model.body.shape[b]
        drag = wp.mat33(0.0)
        give = float(0.0)
        if turning(model, b):
            mobility = scale * point_mobility(mat66_at(model.body.mobility, shape), rotation[b], arm)
            inverse = inverse_root(mobility)
            drag = wp.transpose(inverse) * inverse
            give = wp.max(mobility[0, 0], wp.max(mobility[1, 1], mobility[2, 2]))
        else:
            give = scale * model.body.translation[shape]
            drag = wp.diag(wp.vec3(1.0 / give, 1.0 / give, 1.0 / give))
        return drag, give

    return point_drag


def point_force_term(f: Features) -> wp.Function:
    """`(drags, k, move) -> force` that moves the point of body k."""
    blocks = table(3 * f.bodies, 3)

    @wp.func
    def point_force(drags: blocks, k: int, move: wp.vec3) -> wp.vec3:
        """Force [pN] at a point whose block of `drags` [pN/µm] resists a move [µm]."""
        force = wp.vec3()
        for r in range(3):
            for c in range(3):
                force[r] += drags[3 * k + r, c] * move[c]
        return force

    return point_force


def take_points_term(f: Features) -> wp.Function:
    """`(model, scale, partners, position, rotation, drags, moved, linear, angular, kept)`: take the solution."""
    turning, point_arm, point_force = turning_term(f), point_arm_term(f), point_force_term(f)
    bodies, team = f.bodies, settling_team(f)
    size_of, lane_of = team.size, team.lane
    blocks, long = table(3 * bodies, 3), column(3 * bodies)

    @wp.func
    def take_points(
        model: ModelData, scale: float, partners: int, position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat), drags: blocks, moved: long, linear: wp.array(dtype=wp.vec3),
        angular: wp.array(dtype=wp.vec3), kept: wp.array(dtype=wp.vec3),
    ):  # fmt: skip
        """Add to the moves of the bodies [µm, rad] those that go with the moves of their points [µm], and keep these.

        Each thread of the team moves another body.
        """
        for k in range(wp.static(bodies)):
            b = k + lane_of()
            if k % size_of() == 0 and b < wp.static(bodies):
                move = wp.vec3()
                force = wp.vec3()
                for j in range(wp.static(bodies)):
                    # chosen, not indexed, as above
                    if j == b:
                        move = wp.vec3(moved[3 * j], moved[3 * j + 1], moved[3 * j + 2])
                        force = point_force(drags, j, move)
                kept[b] = move
                if turning(model, b):
                    arm = point_arm(model, position, b, partner_of(partners, b))
                    turn = rigid_response(model.body, b, rotation[b], scale, arm, force)
                    linear[b] = linear[b] + turn.linear
                    angular[b] = angular[b] + turn.angular
                else:
                    linear[b] = linear[b] + move

    return take_points


@wp.func
def balanced_next(before: float, error: float) -> bool:
    """Whether the next of Newton's steps should leave forces in balance for a first stage, by the errors [µm] so far.

    An error is about a constant times the square of the one before it.
    """
    return before > 0.0 and DOUBT * error * error * error <= FIRST_SLACK * BALANCED * before * before


def start_points_term(f: Features) -> wp.Function:
    """`(model, scale, partners, position, rotation, again, kept) -> (drags, gives, moved)` before the first round."""
    point_arm, point_drag = point_arm_term(f), point_drag_term(f)
    bodies, team = f.bodies, settling_team(f)
    size_of, lane_of, value_of = team.size, team.lane, team.value
    blocks, long, short = table(3 * bodies, 3), column(3 * bodies), column(bodies)

    @wp.func
    def start_points(
        model: ModelData, scale: float, partners: int, position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat), again: bool, kept: wp.array(dtype=wp.vec3),
    ):  # fmt: skip
        """Drags [pN/µm], gives [µm/pN] and moves [µm] of the points of all bodies; the moves as `kept` if `again`."""
        drags = blocks()
        gives = short()
        moved = long()
        drag = wp.mat33(0.0)
        give = float(0.0)
        for k in range(wp.static(bodies)):
            lane = k % size_of()
            if lane == 0:
                # a body for each thread of the team, whose drag is then handed round
                b = wp.min(k + lane_of(), wp.static(bodies - 1))
                # a body without a partner is moved by nothing, and any point of it will do
                drag, give = point_drag(
                    model, scale, rotation, b, point_arm(model, position, b, partner_of(partners, b))
                )
            gives[k] = value_of(give, lane)
            for r in range(3):
                for c in range(3):
                    drags[3 * k + r, c] = value_of(drag[r, c], lane)
                if again:
                    moved[3 * k + r] = kept[k][r]
        return drags, gives, moved

    return start_points


def solve_points_term(f: Features) -> wp.Function:
    """`(model, world, listed, count, partners, position, rotation, again, linear, angular, kept, rough) -> float`."""
    gather, solve_system = gather_term(f), solve_system_term(3 * f.bodies)
    start_points, take_points = start_points_term(f), take_points_term(f)
    bodies = f.bodies

    @wp.func
    def solve_points(
        model: ModelData, world: int, listed: ContactList, count: int, partners: int,
        position: wp.array(dtype=wp.vec3), rotation: wp.array(dtype=wp.quat), again: bool,
        linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3), kept: wp.array(dtype=wp.vec3), rough: bool,
    ) -> float:  # fmt: skip
        """Find the depths of all contacts, and add what they move to the free moves of the bodies [µm, rad].

        `kept`: the moves of the points [µm], from which it starts if `again`. A `rough` solution ends with a step after
        which forces should balance, and is not looked at again. Returns how far forces out of balance would move a body
        [µm]: 0 unless the rounds ran out.
        """
        scale = step_over_viscosity(model, world)
        drags, gives, moved = start_points(model, scale, partners, position, rotation, again, kept)
        error = float(0.0)
        last = bool(False)
        for round in range(ROUNDS):
            first = round == 0 and not again
            system, right = gather(listed, count, first, drags, moved)
            if not first:
                before = error
                error = float(0.0)
                for k in range(wp.static(bodies)):
                    left = wp.vec3(right[3 * k], right[3 * k + 1], right[3 * k + 2])
                    error = wp.max(error, length_of(left) * gives[k])
                if error <= BALANCED:
                    error = 0.0
                if error == 0.0 or round == ROUNDS - 1:
                    break
                if rough and balanced_next(before, error):
                    error = 0.0
                    last = True
            moved += wp.where(round < WHOLE_ROUNDS, 1.0, 0.5) * solve_system(system, right)
            if last:
                break
        take_points(model, scale, partners, position, rotation, drags, moved, linear, angular, kept)
        return error

    return solve_points
