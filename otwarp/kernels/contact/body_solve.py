"""The contact forces of one world and step, solved for what they move the bodies instead of for the forces.

With x what all contact forces move the bodies by in a step, s_i = s_i⁰ + J_i x how far gap i opens, and λ_i(s_i) its
law (`implicit_law`), backward Euler asks for

    (M dt)⁻¹ x = Σ J_iᵀ λ_i(s_i⁰ + J_i x),

where ½ xᵀ(M dt)⁻¹x + Σ Φ_i(s_i) is least, −Φ' = λ: a convex energy, whose minimum Newton's method finds,

    ((M dt)⁻¹ + Σ k_i J_iᵀJ_i) Δx = Σ J_iᵀ λ_i − (M dt)⁻¹ x,  k_i = −dλ_i/ds_i,

with each law by the line that stands for it, λ_i = force_i − k_i s_i. The unknowns are as many as the bodies have ways
to move, however many contacts there are; there is no set of pressed contacts to be found, and no matrix of contacts. A
force on a sphere runs through its centre, so that all contacts of a lone sphere with one other body make one matrix of
3×3, Σ k nnᵀ, before they are spread over the unknowns.

The laws are the same as in `solve`, to the same tolerance. That one stays for scenes without a soft contact, and where
bodies do not move by (M dt)⁻¹ of their own: near hydrodynamic walls, and coupled.
"""

import warp as wp

from otwarp.kernels.contact.blocks import block_at, factorise, solve_factorised
from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.implicit_law import PULL_TOLERANCE, depth_at, first_line, line_error
from otwarp.kernels.contact.solve import opening_by_moves
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity
from otwarp.kernels.core.periodic import image_shift
from otwarp.kernels.core.rotation import rotation_matrix
from otwarp.kernels.core.types import ModelData

ROUNDS = wp.constant(24)
"""Most looks at the laws, one more than Newton's steps."""

WHOLE_ROUNDS = wp.constant(8)
"""So many steps are whole; then halves, which cannot go to and fro."""

MAX_NODES = 24
"""Nodes of a world up to which its contacts may be solved so: a row's blocks are bits of a word."""

SOFT = 10.0
"""Largest κ = 1.5·K·√δ·give, at an overlap of a hundredth of the effective radius, of a contact that counts as soft.

With one in a scene all its contacts are solved so: where all are stiffer, the few that press make a smaller system."""


@wp.struct
class SpaceRoom:
    """What it takes to solve the contacts of a world for the moves of its bodies. A node is three unknowns.

    A lone sphere has one node, its displacement; a rigid body another one, its rotation vector.
    """

    node: wp.array(dtype=int)  # (bodies + 1) first node of each
    base: wp.array(
        dtype=wp.mat33
    )  # (3·bodies) (M dt)⁻¹, world axes: force and torque by displacement, torque by rotation
    block: wp.array(dtype=wp.mat33)  # lower triangle of the matrix, and its factor
    filled: wp.array(dtype=int)  # (nodes) bit j of row i: block (i, j) is not zero
    side: wp.array(dtype=wp.vec3)  # (nodes) right-hand sides, then the solution Δx
    moved: wp.array(dtype=wp.vec3)  # (nodes) what contact forces move [µm, rad]
    opening: wp.array(dtype=float)  # (contacts) openings by the free moves [µm]
    depth: wp.array(dtype=float)  # (contacts) δ of each law where it was looked at last [µm]


def nodes_of(f: Features) -> int:
    """Nodes that the bodies of a scene have at most."""
    return (2 if f.rigid else 1) * f.bodies


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


def fill_base_term(f: Features) -> wp.Function:
    """`(model, world, rotation, space)`: (M dt)⁻¹ of all bodies as they are turned now."""
    turning = turning_term(f)

    @wp.func
    def fill_base(model: ModelData, world: int, rotation: wp.array(dtype=wp.quat), space: SpaceRoom):
        """Write the resistances over the time step [pN/µm, pN, pN·µm], and the first node of each body."""
        bodies = int(wp.static(f.bodies))
        over = 1.0 / step_over_viscosity(model, world)
        nodes = int(0)
        for b in range(bodies):
            shape = model.body.shape[b]
            space.node[b] = nodes
            if turning(model, b):
                r = model.body.resistance[shape]
                turn = rotation_matrix(rotation[b])
                back = over * wp.transpose(turn)
                tt = wp.mat33(r[0, 0], r[0, 1], r[0, 2], r[1, 0], r[1, 1], r[1, 2], r[2, 0], r[2, 1], r[2, 2])
                rt = wp.mat33(r[3, 0], r[3, 1], r[3, 2], r[4, 0], r[4, 1], r[4, 2], r[5, 0], r[5, 1], r[5, 2])
                rr = wp.mat33(r[3, 3], r[3, 4], r[3, 5], r[4, 3], r[4, 4], r[4, 5], r[5, 3], r[5, 4], r[5, 5])
                space.base[3 * b] = turn * tt * back
                space.base[3 * b + 1] = turn * rt * back
                space.base[3 * b + 2] = turn * rr * back
                nodes += 2
            else:
                drag = over / model.body.translation[shape]
                space.base[3 * b] = wp.diag(wp.vec3(drag, drag, drag))
                nodes += 1
        space.node[bodies] = nodes

    return fill_base


def start_matrix_term(f: Features) -> wp.Function:
    """`(model, space)`: the matrix and right-hand sides without contacts."""
    turning = turning_term(f)

    @wp.func
    def start_matrix(model: ModelData, space: SpaceRoom):
        """Write (M dt)⁻¹ [pN/µm, pN, pN·µm] as the matrix, and −(M dt)⁻¹x as right-hand sides [pN, pN·µm]."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            i = space.node[b]
            push = space.base[3 * b]
            space.block[block_at(i, i)] = push
            space.filled[i] = 0
            space.side[i] = -(push * space.moved[i])
            if turning(model, b):
                both = space.base[3 * b + 1]
                twist = space.base[3 * b + 2]
                space.block[block_at(i + 1, i)] = both
                space.block[block_at(i + 1, i + 1)] = twist
                space.filled[i + 1] = 1 << i
                space.side[i] = space.side[i] - wp.transpose(both) * space.moved[i + 1]
                space.side[i + 1] = -(both * space.moved[i] + twist * space.moved[i + 1])

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
    """`(model, allowed, space) -> error`: how far forces out of balance move a body."""
    turning = turning_term(f)

    @wp.func
    def unbalanced(model: ModelData, allowed: float, space: SpaceRoom) -> float:
        """About how far [µm] the right-hand sides would move the body that they move farthest; 0 within `allowed`."""
        error = float(0.0)
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            i = space.node[b]
            push = space.base[3 * b][0, 0]
            way = wp.length(space.side[i]) / push
            if turning(model, b):
                way += wp.length(space.side[i + 1]) / wp.sqrt(push * space.base[3 * b + 2][0, 0])
            error = wp.max(error, way)
        return wp.where(error > allowed, error, 0.0)

    return unbalanced


def gather_term(f: Features) -> wp.Function:
    """`(model, contacts, count, position, follow, space) -> float`: all that one of Newton's steps needs."""
    turning = turning_term(f)
    start_matrix = start_matrix_term(f)
    join_bodies = join_bodies_term(f)
    unbalanced = unbalanced_term(f)

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

    @wp.func
    def follow_law(contacts: wp.array(dtype=Contact), i: int, s: float, space: SpaceRoom) -> float:
        """The error of contact i's line at the opening `s` [µm]; unless it is little, the tangent there as new line."""
        c = contacts[i]
        d = depth_at(c, s, space.depth[i])
        root = wp.sqrt(d.value)
        load = c.floor + c.hardness * d.value * root
        missed = line_error(c, s, d, load)
        if missed > 0.0:
            k = 1.5 * c.hardness * root * d.slope
            space.depth[i] = d.value
            contacts[i].stiffness = k
            contacts[i].force = load + k * s
        return missed

    @wp.func
    def gather(
        model: ModelData, contacts: wp.array(dtype=Contact), count: int, position: wp.array(dtype=wp.vec3),
        follow: bool, space: SpaceRoom,
    ) -> float:  # fmt: skip
        """Fill matrix and right-hand sides from the lines of the contacts, new ones where these miss their laws.

        Neighbours in the list that are contacts of the same two bodies, one of them a lone sphere, go together, as one
        at its centre. Writes the loads [pN] as well; returns the largest error of a gap [µm], 0 unless `follow`.
        """
        start_matrix(model, space)
        worst = float(0.0)
        i = int(0)
        while i < count:
            a = contacts[i].a
            b = contacts[i].b
            arm_a = contacts[i].arm_a
            arm_b = contacts[i].arm_b
            lone_a = not turning(model, a)
            lone_b = b >= 0 and not turning(model, wp.max(b, 0))
            between = position[wp.max(b, 0)] - position[a]
            if wp.static(f.periodic):
                between += image_shift(model.period, between)
            if lone_b:
                arm_a = between
            elif lone_a and b >= 0:
                arm_b = -between
            way = moved_at(model, a, arm_a, space) - moved_at(model, b, arm_b, space)
            stiffness = wp.mat33(0.0)
            force = wp.vec3(0.0)
            presses = bool(False)
            joined = bool(True)
            while joined:
                n = contacts[i].normal
                s = space.opening[i] + wp.dot(way, n)
                if follow:
                    worst = wp.max(worst, follow_law(contacts, i, s, space))
                k = contacts[i].stiffness
                load = contacts[i].force - k * s
                contacts[i].load = wp.max(load, contacts[i].floor)
                presses = presses or k > 0.0 or load != 0.0
                stiffness = stiffness + wp.outer(k * n, n)
                force = force + load * n
                i += 1
                joined = i < count and (lone_a or lone_b)
                if joined:
                    joined = contacts[i].a == a and contacts[i].b == b
            if presses:
                join_bodies(model, a, b, arm_a, arm_b, stiffness, force, space)
        if follow and worst == 0.0:
            # what float32 left of the equation of motion, where contacts are stiff
            worst = unbalanced(model, PULL_TOLERANCE * contacts[0].radius, space)
        return worst

    return gather


def solve_bodies_term(f: Features) -> wp.Function:
    """`(model, contacts, count, position, again, linear, angular, space) -> float`: solve all contacts."""
    turning = turning_term(f)
    gather = gather_term(f)

    @wp.func
    def solve_bodies(
        model: ModelData, contacts: wp.array(dtype=Contact), count: int, position: wp.array(dtype=wp.vec3), again: bool,
        linear: wp.array(dtype=wp.vec3), angular: wp.array(dtype=wp.vec3), space: SpaceRoom,
    ) -> float:  # fmt: skip
        """Write the loads of one step, and add what they move to the free moves of the bodies [µm, rad].

        `again`: the lines of the contacts are those of an earlier solution of this step. Returns the largest error
        left in a gap [µm]: 0 unless the rounds ran out.
        """
        bodies = int(wp.static(f.bodies))
        nodes = space.node[bodies]
        for i in range(count):
            opening = opening_by_moves(contacts[i], linear, angular)
            space.opening[i] = opening
            if not again:
                line = first_line(contacts[i], opening)
                contacts[i].force = line[0]
                contacts[i].stiffness = line[1]
                space.depth[i] = line[2]
        for i in range(nodes):
            space.moved[i] = wp.vec3(0.0)
        worst = float(0.0)
        for round in range(ROUNDS):
            worst = gather(model, contacts, count, position, round > 0, space)
            if round > 0 and (worst == 0.0 or round == ROUNDS - 1):
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
        return worst

    return solve_bodies
