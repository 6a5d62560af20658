"""Far-field hydrodynamic coupling: how the bodies of one world move and shake each other through the liquid.

Every body moves as before by its own 6×6 mobility; a force on one also carries all the others along,

    U_i = (M_i load_i)_t + Σ_j P_ij F_j / η + u_i,      Ω_i = (M_i load_i)_r + ω_i,

where P_ij is the Rotne–Prager–Yamakawa tensor of two spheres of radii a_i and a_j about the centres of diffusion. The
radii touch the order a²/r³ alone, not the leading, Oseen term. They are those of spheres that have in all directions
the largest drag that the body has in any, 6πη a_i = λ_max(R_tt) with R = M_i⁻¹. With smaller radii, as those of the
mean mobility, the whole matrix could lose its positive definiteness where long bodies lie side by side; with these it
cannot, because

    (M_tt − M_tr M_rr⁻¹ M_rt)_i = (R_tt)_i⁻¹ ≥ 1/6πη a_i,

and the tensors of spheres with these self-mobilities are positive definite at any distance, overlapping too. For a lone
sphere it is its own radius. Left out are how a force turns others and a torque carries them along, which falls as 1/r²,
and how bodies disturb a background flow and each other's shape of it.

Noise: √(2 k_B T dt) times the Cholesky factor of the whole matrix. Rotations come first, for each body alone, and
translations given them: what is left is the 3n × 3n matrix with (R_tt)_i⁻¹ on its diagonal and P_ij beside it, so that
no body needs more deviates than it does alone.

Drift: ∇·M = 0. Each P is an average of the Oseen tensor over both surfaces, in all its ranges, and that is free of
divergence; it does not depend on how bodies are turned; and about the centre of diffusion the self-mobilities need no
correction (Brenner 1967, J. Colloid Interface Sci. 23, 407). So the noise, taken with the matrix at the start of
the step, brings no drift of its own. Heun's step finds the forces and P anew at its end; its noise keeps the matrix of
the start. It is of weak order 2 as far as P is constant over what bodies move in a step, else of order 1.

Sources: J. Rotne, S. Prager, J. Chem. Phys. 50, 4831 (1969), doi:10.1063/1.1670977; E. Wajnryb, K. A. Mizerski,
P. J. Zuk, P. Szymczak, J. Fluid Mech. 731, R3 (2013), doi:10.1017/jfm.2013.402; P. J. Zuk, E. Wajnryb, K. A. Mizerski,
P. Szymczak, J. Fluid Mech. 741, R5 (2014), doi:10.1017/jfm.2013.668; D. L. Ermak, J. A. McCammon, J. Chem. Phys. 69,
1352 (1978), doi:10.1063/1.436761.
"""

import dataclasses

import warp as wp

from otwarp.kernels.bodies.bead import bead_constants_term, bead_dynamics
from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.kernels.bodies.rigid import (
    angular_part,
    flow_velocity_term,
    linear_part,
    mobility_product,
    rigid_constants_term,
    twist,
)
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity, thermal_energy_of
from otwarp.kernels.core.noise import six_deviates_term, three_deviates_term
from otwarp.kernels.core.rounding import PI
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData, vec6
from otwarp.kernels.core.worlds import number_term
from otwarp.kernels.forces.total import body_total

COUPLED = ("heun", "eulerMaruyama")
"""Integrators that serve coupled bodies: the others need a constant matrix of noise or of relaxation."""

PIVOT = wp.constant(1.0e-6)
"""Pivot of the factorisation, relative to its diagonal, that may be nothing but rounding, and counts as 0 with its
column: what float32 leaves of equal spheres at one place, which move as one."""


def block_count(bodies: int) -> int:
    """Blocks of a lower triangle of `bodies` rows, its diagonal included."""
    return bodies * (bodies + 1) // 2


@wp.func
def block_at(i: int, j: int) -> int:
    """Index of block (i, j ≤ i) of a lower triangle that is stored row by row."""
    return i * (i + 1) // 2 + j


@wp.func
def pair_mobility(way: wp.vec3, a: float, b: float) -> wp.mat33:
    """Velocity of one sphere per force on the other at unit viscosity [1/µm]: P = p I + q r̂r̂, symmetric.

    apart:        p = (1 + (a² + b²)/3r²)/8πr,  q = (1 − (a² + b²)/r²)/8πr
    overlapping:  p = (16(a + b) − r(3 + e²)²)/192πab,  q = 3r(1 − e²)²/192πab,  e = (a − b)/r
    inside:       p = 1/6π max(a, b),  q = 0

    Args:
        way: From one centre to the other [µm].
        a, b: Radii [µm].

    Source: Zuk et al. 2014, doi:10.1017/jfm.2013.668.
    """
    r = wp.length(way)
    p = 1.0 / (6.0 * PI * wp.max(a, b))
    q = float(0.0)
    n = wp.vec3(0.0)
    if r > wp.abs(a - b):
        n = way / r
        if r > a + b:
            far = 1.0 / (8.0 * PI * r)
            squares = (a * a + b * b) / (r * r)
            p = far * (1.0 + squares / 3.0)
            q = far * (1.0 - squares)
        else:
            e = (a - b) / r
            near = 1.0 / (192.0 * PI * a * b)
            p = near * (16.0 * (a + b) - r * (3.0 + e * e) * (3.0 + e * e))
            q = near * 3.0 * r * (1.0 - e * e) * (1.0 - e * e)
    return wp.outer(q * n, n) + wp.diag(wp.vec3(p, p, p))


@wp.func
def fill_pairs(
    model: ModelData, world: int, bodies: int, position: wp.array(dtype=wp.vec3), pair: wp.array(dtype=wp.mat33)
):
    """Write P dt/η of all pairs below the diagonal of the triangle `pair` [µm/pN]; the diagonal is left alone."""
    scale = step_over_viscosity(model, world)
    for i in range(bodies):
        a = model.coupling.radius[model.body.shape[i]]
        for j in range(i):
            b = model.coupling.radius[model.body.shape[j]]
            pair[block_at(i, j)] = scale * pair_mobility(position[i] - position[j], a, b)


@wp.func
def carry_others(
    bodies: int, pair: wp.array(dtype=wp.mat33), force: wp.array(dtype=wp.vec3), move: wp.array(dtype=vec6)
):
    """Add to the moves [µm, rad] of all bodies what the forces on the others [pN] carry them along in one step."""
    for i in range(bodies):
        for j in range(i):
            p = pair[block_at(i, j)]
            move[i] = move[i] + twist(p * force[j], wp.vec3(0.0))
            move[j] = move[j] + twist(p * force[i], wp.vec3(0.0))


@wp.func
def pivot_root(pivot: float, least: float) -> float:
    """√pivot, or 0 where the pivot is not above `least`, what rounding may leave of it."""
    root = float(0.0)
    if pivot > least:
        root = wp.sqrt(pivot)
    return root


@wp.func
def inverse_pivot(root: float) -> float:
    """1/root, or 0 for a root of 0, whose column then counts as 0."""
    inverse = float(0.0)
    if root > 0.0:
        inverse = 1.0 / root
    return inverse


@wp.func
def lower_root(m: wp.mat33, least: wp.vec3) -> wp.mat33:
    """Lower Cholesky factor of a symmetric matrix; a pivot below `least` and all under it are 0."""
    x = pivot_root(m[0, 0], least[0])
    yx = m[1, 0] * inverse_pivot(x)
    zx = m[2, 0] * inverse_pivot(x)
    y = pivot_root(m[1, 1] - yx * yx, least[1])
    zy = (m[2, 1] - zx * yx) * inverse_pivot(y)
    z = pivot_root(m[2, 2] - zx * zx - zy * zy, least[2])
    return wp.mat33(x, 0.0, 0.0, yx, y, 0.0, zx, zy, z)


@wp.func
def over_transposed(m: wp.mat33, root: wp.mat33) -> wp.mat33:
    """X = m L⁻ᵀ of a lower triangle L = `root`, by substitution; columns of a zero pivot are 0."""
    first = wp.vec3(m[0, 0], m[1, 0], m[2, 0]) * inverse_pivot(root[0, 0])
    second = (wp.vec3(m[0, 1], m[1, 1], m[2, 1]) - root[1, 0] * first) * inverse_pivot(root[1, 1])
    third = wp.vec3(m[0, 2], m[1, 2], m[2, 2]) - root[2, 0] * first - root[2, 1] * second
    third = third * inverse_pivot(root[2, 2])
    return wp.matrix_from_cols(first, second, third)


@wp.func
def factorise_blocks(bodies: int, root: wp.array(dtype=wp.mat33)):
    """Cholesky factor of a matrix of 3×3 blocks, kept as a lower triangle, in its place."""
    for j in range(bodies):
        own = root[block_at(j, j)]
        least = PIVOT * wp.vec3(own[0, 0], own[1, 1], own[2, 2])
        for k in range(j):
            left = root[block_at(j, k)]
            own = own - left * wp.transpose(left)
        diagonal = lower_root(own, least)
        root[block_at(j, j)] = diagonal
        for i in range(j + 1, bodies):
            block = root[block_at(i, j)]
            for k in range(j):
                block = block - root[block_at(i, k)] * wp.transpose(root[block_at(j, k)])
            root[block_at(i, j)] = over_transposed(block, diagonal)


def fill_root_term(f: Features) -> wp.Function:
    """`(model, world, rotation, pair, root)`: write the factor of what translations have beside rotations."""

    @wp.func
    def given_turning(model: ModelData, b: int, rotation: wp.quat, scale: float) -> wp.mat33:
        """dt (R_tt)⁻¹ of a body, world axes [µm/pN]."""
        shape = model.body.shape[b]
        mobility = scale * model.body.translation[shape]
        block = wp.diag(wp.vec3(mobility, mobility, mobility))
        if wp.static(f.rigid):
            if model.body.rigid[b] != 0:
                turn = wp.quat_to_matrix(rotation)
                block = scale * (turn * model.coupling.given_turning[shape] * wp.transpose(turn))
        return block

    @wp.func
    def fill_root(
        model: ModelData, world: int, rotation: wp.array(dtype=wp.quat), pair: wp.array(dtype=wp.mat33),
        root: wp.array(dtype=wp.mat33),
    ):  # fmt: skip
        """Cholesky factor of (R_tt)⁻¹ and P, times dt/η [µm/pN], in blocks."""
        bodies = int(wp.static(f.bodies))
        scale = step_over_viscosity(model, world)
        for i in range(bodies):
            for j in range(i):
                root[block_at(i, j)] = pair[block_at(i, j)]
            root[block_at(i, i)] = given_turning(model, i, rotation[i], scale)
        factorise_blocks(bodies, root)

    return fill_root


def shake_term(f: Features) -> wp.Function:
    """`(model, world, rotation, root, step, move)`: add the thermal moves of all bodies; `root` as `fill_root` left it.

    Each body draws the deviates that it would draw alone.
    """
    three_deviates = three_deviates_term(f.noise, f.fast_math)
    six_deviates = six_deviates_term(f.noise, f.fast_math)
    number = number_term(f)

    @wp.func
    def shake(
        model: ModelData, world: int, rotation: wp.array(dtype=wp.quat), root: wp.array(dtype=wp.mat33), step: wp.int64,
        move: wp.array(dtype=vec6),
    ):  # fmt: skip
        """Add rotations, the translations that go with them, and the translations given them [µm, rad]."""
        bodies = int(wp.static(f.bodies))
        energy = thermal_energy_of(model, world)
        spread = wp.sqrt(2.0 * energy)
        turning = wp.sqrt(2.0 * energy * step_over_viscosity(model, world))
        for j in range(bodies):
            xi = wp.vec3(0.0)
            if wp.static(f.spheres):
                if model.body.rigid[j] == 0:
                    xi = three_deviates(model.seed, step, number(model, world), j)
            if wp.static(f.rigid):
                if model.body.rigid[j] != 0:
                    six = six_deviates(model.seed, step, number(model, world), j)
                    xi = linear_part(six)
                    shape = model.body.shape[j]
                    w = turning * (model.coupling.turning_root[shape] * angular_part(six))
                    v = model.coupling.with_turning[shape] * w
                    move[j] = move[j] + twist(wp.quat_rotate(rotation[j], v), wp.quat_rotate(rotation[j], w))
            xi = spread * xi
            for i in range(j, bodies):
                move[i] = move[i] + twist(root[block_at(i, j)] * xi, wp.vec3(0.0))

    return shake


def own_drift_term(f: Features) -> wp.Function:
    """`(model, control, state, world, b, pose, time) -> (force, move)`: total force on a body [pN], and what its own
    load and the flow move it in one step."""
    # noise has factors of its own here
    quiet = dataclasses.replace(f, brownian=False)
    bead_constants = bead_constants_term(quiet)
    still = bead_dynamics(dataclasses.replace(quiet, flow=None)).drift
    flow_at = FLOW_TERMS[f.flow] if f.flow else None
    rigid_constants = rigid_constants_term(quiet) if f.rigid else None
    wrench = body_total(f) if f.rigid else None
    flow_velocity = flow_velocity_term(f) if f.rigid and f.flow else None

    @wp.func
    def own_drift(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, pose: Pose, time: wp.float64
    ):
        """Sum over `FORCES` as a force [pN], and M (F, T) dt + flow [µm, rad] of body b."""
        force = wp.vec3(0.0)
        move = vec6()
        if wp.static(f.rigid):
            if model.body.rigid[b] != 0:
                body = rigid_constants(model, control, world, b)
                load = wrench(model, control, state, body, world, b, pose, time)
                force = load.force
                move = mobility_product(body, pose, twist(load.force, load.torque))
                if wp.static(f.flow is not None):
                    move += wp.float32(model.time_step) * flow_velocity(model, world, b, pose)
        if wp.static(f.spheres):
            if model.body.rigid[b] == 0:
                bead = bead_constants(model, control, world, b)
                v = still(model, control, state, bead, world, b, pose.position, time)
                force = v / bead.mobility_dt
                if wp.static(f.flow is not None):
                    v += (
                        wp.float32(model.time_step) * flow_at(model.flow, world, pose.position, bead.drag_radius).linear
                    )
                move = twist(v, wp.vec3(0.0))
        return force, move

    return own_drift


def coupled_drift_term(f: Features) -> wp.Function:
    """`(model, control, state, world, position, rotation, time, pair, force, drift)`: the drift of all bodies per step.

    Writes `pair`, the forces on the bodies, and `drift`.
    """
    own_drift = own_drift_term(f)

    @wp.func
    def coupled_drift(
        model: ModelData, control: ControlData, state: StateData, world: int, position: wp.array(dtype=wp.vec3),
        rotation: wp.array(dtype=wp.quat), time: wp.float64, pair: wp.array(dtype=wp.mat33),
        force: wp.array(dtype=wp.vec3), drift: wp.array(dtype=vec6),
    ):  # fmt: skip
        """Drift of each body by its own load and the flow, plus what all others carry it along [µm, rad]."""
        bodies = int(wp.static(f.bodies))
        for b in range(bodies):
            load, move = own_drift(model, control, state, world, b, Pose(position[b], rotation[b]), time)
            force[b] = load
            drift[b] = move
        fill_pairs(model, world, bodies, position, pair)
        carry_others(bodies, pair, force, drift)

    return coupled_drift
