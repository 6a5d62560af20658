"""The contact forces of one world and step, solved for what they move the bodies instead of for the forces.

With x what all contact forces move the bodies by in a step, s_i = s_i⁰ + J_i x how far gap i opens, and λ_i(s_i) its
law (`implicit_law`), backward Euler asks for

    (M dt)⁻¹ x = Σ J_iᵀ λ_i(s_i⁰ + J_i x),

where ½ xᵀ(M dt)⁻¹x + Σ Φ_i(s_i) is least, −Φ' = λ: a convex energy, whose minimum Newton's method finds,

    ((M dt)⁻¹ + Σ k_i J_iᵀJ_i) Δx = Σ J_iᵀ λ_i − (M dt)⁻¹ x,  k_i = −dλ_i/ds_i.

The unknowns are as many as the bodies have ways to move, however many contacts there are; there is no set of pressed
contacts to be found, and no matrix of contacts. A force on a sphere runs through its centre, so that all contacts of a
lone sphere with one other body make one matrix of 3×3, Σ k nnᵀ, before they are spread over the unknowns.

The laws are the same as in `solve`, to the same tolerance. That one stays for scenes without a soft contact, and where
bodies do not move by (M dt)⁻¹ of their own: near hydrodynamic walls, and coupled.
"""

import warp as wp

from otwarp.kernels.contact.blocks import block_at, factorise, solve_factorised
from otwarp.kernels.contact.contact_list import ContactList, law_of, opened_by
from otwarp.kernels.contact.implicit_law import Line, line_of
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity
from otwarp.kernels.core.packed import point_of
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.rotation import rotation_matrix
from otwarp.kernels.core.rounding import PRECISION
from otwarp.kernels.core.team import ALONE, Team, team_of
from otwarp.kernels.core.types import ModelData

ROUNDS = wp.constant(24)
"""Most looks at the laws, one more than Newton's steps."""

WHOLE_ROUNDS = wp.constant(20)
"""So many steps are whole; then halves, which cannot go to and fro."""

BALANCED = wp.constant(1.0e-10 if PRECISION == "float64" else 1.0e-5)
"""How far [µm] what is out of balance would move a body at most: contacts are solved. Far less in float64."""

MAX_NODES = 24
"""Nodes of a world up to which its contacts may be solved so: a row's blocks are bits of a word."""

MAX_POINTS = 4
"""Bodies of a world up to which its contacts may be solved as in `point_solve`: its matrix is written out."""

SOFT = 10.0
"""Largest κ = 1.5·K·√δ·give, at an overlap of a hundredth of the effective radius, of a contact that counts as soft.

With one in a scene all its contacts are solved so: where all are stiffer, the few that press make a smaller system."""


@wp.struct
class SpaceRoom:
    """What it takes to solve the contacts of a world for the moves of its bodies. A node is three unknowns.

    A lone sphere has one node, its displacement; a rigid body another one, its rotation vector.
    """

    node: wp.array(dtype=int)  # (bodies + 1) first node of each
    block: wp.array(dtype=wp.mat33)  # lower triangle of the matrix, and its factor
    filled: wp.array(dtype=int)  # (nodes) bit j of row i: block (i, j) is not zero
    side: wp.array(dtype=wp.vec3)  # (nodes) right-hand sides, then the solution Δx
    moved: wp.array(dtype=wp.vec3)  # (nodes) what contact forces move [µm, rad]


def nodes_of(f: Features) -> int:
    """Nodes that the bodies of a scene have at most."""
    return (2 if f.rigid else 1) * f.bodies


def settling_team(f: Features) -> Team:
    """Who solves the contacts of a world: several threads where `point_solve` may, else one."""
    return team_of(f) if f.body_space and f.bodies <= MAX_POINTS else ALONE


def turning_term(f: Features) -> wp.Function:
    """`(model, b) -> bool`: whether body b has a node for its rotation."""

    @wp.func
    def turning(model: ModelData, b: int) -> bool:
        """Whether a body is rigid, and not a lone sphere."""
        turns = bool(wp.static(f.rigid))
        if wp.static(f.rigid and f.spheres):
            turns = model.body.rigid[b] != 0
        return turns

    return turning


def number_nodes_term(f: Features) -> wp.Function:
    """`(model, again, space) -> nodes`: number the nodes, with no move yet unless they are solved `again`."""
    turning = turning_term(f)

    @wp.func
    def number_nodes(model: ModelData, again: bool, space: SpaceRoom) -> int:
        """How many nodes the bodies have."""
        bodies = int(wp.static(f.bodies))
        nodes = int(0)
        for b in range(bodies):
            space.node[b] = nodes
            nodes += wp.where(turning(model, b), 2, 1)
        space.node[bodies] = nodes
        if not again:
            for i in range(nodes):
                space.moved[i] = wp.vec3(0.0)
        return nodes

    return number_nodes


def start_matrix_term(f: Features) -> wp.Function:
    """`(model, world, rotation, space)`: the matrix and right-hand sides without contacts."""
    turning = turning_term(f)

    @wp.func
    def start_matrix(model: ModelData, world: int, rotation: wp.array(dtype=wp.quat), space: SpaceRoom):
        """Write (M dt)⁻¹ [pN/µm, pN, pN·µm] as the matrix, world axes, and −(M dt)⁻¹x as right-hand sides."""
        bodies = int(wp.static(f.bodies))
        over = 1.0 / step_over_viscosity(model, world)
        for b in range(bodies):
            i = space.node[b]
            shape = model.body.shape[b]
            space.filled[i] = 0
            if turning(model, b):
                r = model.body.resistance[shape]
                turn = rotation_matrix(rotation[b])
                back = over * wp.transpose(turn)
                tt = wp.mat33(r[0, 0], r[0, 1], r[0, 2], r[1, 0], r[1, 1], r[1, 2], r[2, 0], r[2, 1], r[2, 2])
                rt = wp.mat33(r[3, 0], r[3, 1], r[3, 2], r[4, 0], r[4, 1], r[4, 2], r[5, 0], r[5, 1], r[5, 2])
                rr = wp.mat33(r[3, 3], r[3, 4], r[3, 5], r[4, 3], r[4, 4], r[4, 5], r[5, 3], r[5, 4], r[5, 5])
                push = turn * tt * back
                both = turn * rt * back
                twist = turn * rr * back
                space.block[block_at(i, i)] = push
                space.block[block_at(i + 1, i)] = both
                space.block[block_at(i + 1, i + 1)] = twist
                space.filled[i + 1] = 1 << i
                way = space.moved[i]
                angle = space.moved[i + 1]
                space.side[i] = -(push * way + wp.transpose(both) * angle)
                space.side[i + 1] = -(both * way + twist * angle)
            else:
                drag = over / model.body.translation[shape]
                space.block[block_at(i, i)] = wp.diag(wp.vec3(drag, drag, drag))
                space.side[i] = -drag * space.moved[i]

    return start_matrix


def join_bodies_term(f: Features) -> wp.Function:
    """`(model, a, b, arm_a, arm_b, stiffness, force, space)`: spread contacts of two bodies over the unknowns."""
    turning = turning_term(f)

    @wp.func
    def add_block(space: SpaceRoom, i: int, j: int, block: wp.mat33):
        """Add to block (i, j < i), which may be zero so far."""
        at = block_at(i, j)
        if (space.filled[i] >> j) & 1 != 0:
            space.block[at] = space.block[at] + block
        else:
            space.block[at] = block
            space.filled[i] = space.filled[i] | (1 << j)

    @wp.func
    def add_own(model: ModelData, b: int, arm: wp.vec3, stiffness: wp.mat33, force: wp.vec3, space: SpaceRoom):
        """Add what a body's own unknowns see of contacts at `arm` [µm] that push it by `force` [pN]."""
        i = space.node[b]
        space.block[block_at(i, i)] = space.block[block_at(i, i)] + stiffness
        space.side[i] = space.side[i] + force
        if turning(model, b):
            turned = wp.skew(arm) * stiffness
            space.block[block_at(i + 1, i)] = space.block[block_at(i + 1, i)] + turned
            space.block[block_at(i + 1, i + 1)] = space.block[block_at(i + 1, i + 1)] - turned * wp.skew(arm)
            space.side[i + 1] = space.side[i + 1] + wp.cross(arm, force)

    @wp.func
    def join_bodies(
        model: ModelData, a: int, b: int, arm_a: wp.vec3, arm_b: wp.vec3, stiffness: wp.mat33, force: wp.vec3,
        space: SpaceRoom,
    ):  # fmt: skip
        """Add JᵀkJ and Jᵀλ of contacts whose forces all run through the point at the arms; a comes after b."""
        add_own(model, a, arm_a, stiffness, force, space)
        if b >= 0:
            add_own(model, b, arm_b, stiffness, -force, space)
            i = space.node[a]
            j = space.node[b]
            add_block(space, i, j, -stiffness)
            if wp.static(f.rigid):
                turned = wp.skew(arm_a) * stiffness
                if turning(model, a):
                    add_block(space, i + 1, j, -turned)
                if turning(model, b):
                    add_block(space, i, j + 1, stiffness * wp.skew(arm_b))
                    if turning(model, a):
                        add_block(space, i + 1, j + 1, turned * wp.skew(arm_b))

    return join_bodies


def unbalanced_term(f: Features) -> wp.Function:
    """`(model, world, space) -> error`: how far forces out of balance move a body."""
    turning = turning_term(f)

    @wp.func
    def unbalanced(model: ModelData, world: int, space: SpaceRoom) -> float:
        """About how far [µm] the right-hand sides would move the body that they move farthest."""
        error = float(0.0)
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            i = space.node[b]
            shape = model.body.shape[b]
            way = float(0.0)
            if turning(model, b):
                push = model.body.resistance[shape][0, 0]
                twist = model.body.resistance[shape][3, 3]
                way = wp.length(space.side[i]) / push + wp.length(space.side[i + 1]) / wp.sqrt(push * twist)
            else:
                way = wp.length(space.side[i]) * model.body.translation[shape]
            error = wp.max(error, way)
        return error * step_over_viscosity(model, world)

    return unbalanced


@wp.func
def line_at(listed: ContactList, i: int, opening: float, first: bool) -> Line:
    """Load and slope of contact i where its gap opens by `opening` [µm]; `first`: where it would end alone."""
    line = line_of(law_of(listed.law[i], listed.path[i]), opening, listed.depth[i], first)
    listed.depth[i] = line.depth
    return line


def moved_at_term(f: Features) -> wp.Function:
    """`(model, b, arm, space) -> way`: how far a point of a body has come."""
    turning = turning_term(f)

    @wp.func
    def moved_at(model: ModelData, b: int, arm: wp.vec3, space: SpaceRoom) -> wp.vec3:
        """What contact forces move the point of a body at `arm` by [µm]; nothing of an obstacle."""
        way = wp.vec3(0.0)
        if b >= 0:
            i = space.node[b]
            way = space.moved[i]
            if turning(model, b):
                way += wp.cross(space.moved[i + 1], arm)
        return way

    return moved_at


def gather_term(f: Features) -> wp.Function:
    """`(model, world, listed, count, position, rotation, first, space)`: all that one of Newton's steps needs."""
    turning, moved_at = turning_term(f), moved_at_term(f)
    start_matrix = start_matrix_term(f)
    join_bodies = join_bodies_term(f)

    @wp.func
    def gather(
        model: ModelData, world: int, listed: ContactList, count: int, position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat), first: bool, space: SpaceRoom,
    ):  # fmt: skip
        """Fill matrix and right-hand sides from the laws of the contacts.

        Neighbours in the list that are contacts of the same two bodies, one of them a lone sphere, go together, as one
        at its centre.
        """
        start_matrix(model, world, rotation, space)
        i = int(0)
        while i < count:
            pair = listed.pair[i]
            a = pair[0]
            b = pair[1]
            arm_a = point_of(listed.arm_a[i])
            lone_a = not turning(model, a)
            lone_b = b >= 0 and not turning(model, wp.max(b, 0))
            between = position[wp.max(b, 0)] - position[a]
            if wp.static(f.periodic):
                between += image_shift(model.period, between)
            if lone_b:
                arm_a = between
            elif lone_a:
                arm_a = wp.vec3(0.0)
            # forces run through both arms of a contact, so that one point serves for both bodies
            arm_b = arm_a - between
            way = moved_at(model, a, arm_a, space) - moved_at(model, b, arm_b, space)
            stiffness = wp.mat33(0.0)
            force = wp.vec3(0.0)
            joined = bool(True)
            while joined:
                face = listed.face[i]
                n = point_of(face)
                line = line_at(listed, i, opened_by(face) + wp.dot(way, n), first)
                stiffness = stiffness + wp.outer(line.slope * n, n)
                force = force + line.load * n
                i += 1
                joined = i < count and (lone_a or lone_b)
                if joined:
                    joined = listed.pair[i] == pair
            if stiffness[0, 0] + stiffness[1, 1] + stiffness[2, 2] > 0.0 or wp.length_sq(force) > 0.0:
                join_bodies(model, a, b, arm_a, arm_b, stiffness, force, space)

    return gather


def solve_bodies_term(f: Features) -> wp.Function:
    """`(model, world, listed, count, position, rotation, again, linear, angular, space) -> float`: solve all contacts.

    The gaps are those that `open_gaps_term` wrote.
    """
    turning = turning_term(f)
    number_nodes = number_nodes_term(f)
    gather = gather_term(f)
    unbalanced = unbalanced_term(f)

    @wp.func
    def solve_bodies(
        model: ModelData, world: int, listed: ContactList, count: int, position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat), again: bool, linear: wp.array(dtype=wp.vec3),
        angular: wp.array(dtype=wp.vec3), space: SpaceRoom,
    ) -> float:  # fmt: skip
        """Find the depths of all contacts, and add what they move to the free moves of the bodies [µm, rad].

        `again`: start from an earlier solution of this step. Returns how far forces out of balance would move a body
        [µm]: 0 unless the rounds ran out.
        """
        bodies = int(wp.static(f.bodies))
        nodes = number_nodes(model, again, space)
        error = float(0.0)
        for round in range(ROUNDS):
            first = round == 0 and not again
            gather(model, world, listed, count, position, rotation, first, space)
            if not first:
                error = unbalanced(model, world, space)
                if error <= BALANCED:
                    error = 0.0
                if error == 0.0 or round == ROUNDS - 1:
                    break
            factorise(nodes, space.filled, space.block)
            solve_factorised(nodes, space.filled, space.block, space.side)
            share = wp.where(round < WHOLE_ROUNDS, 1.0, 0.5)
            for i in range(nodes):
                space.moved[i] = space.moved[i] + share * space.side[i]
        for b in range(bodies):
            i = space.node[b]
            linear[b] = linear[b] + space.moved[i]
            if turning(model, b):
                angular[b] = angular[b] + space.moved[i + 1]
        return error

    return solve_bodies
