"""A rigid body of several spheres: its constants, and how it drifts and diffuses in one step with full coupling.

Moves are twists: displacement of the centre of diffusion and rotation vector, in world axes.
"""

import warp as wp

from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.kernels.bodies.rotational_noise import turned_along, turning_root
from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity, thermal_energy_of
from otwarp.kernels.core.noise import six_deviates_term
from otwarp.kernels.core.packed import point_of, radius_of
from otwarp.kernels.core.reads import mat66_at
from otwarp.kernels.core.rotation import rotate_by, rotation_matrix
from otwarp.kernels.core.step_constants import RigidConstants
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData, mat66, vec6
from otwarp.kernels.core.worlds import number_term
from otwarp.kernels.cpu.rigid_block import kept_mobility_product, kick_at
from otwarp.kernels.forces.table import active_forces
from otwarp.kernels.forces.total import body_stiffness_total, body_total
from otwarp.kernels.optics.aims import kept_aims_term
from otwarp.kernels.optics.near_traps import strayed


@wp.func
def twist(linear: wp.vec3, angular: wp.vec3) -> vec6:
    """(linear, angular) as one vector: a move [µm, rad] or a wrench [pN, pN·µm]."""
    return vec6(linear[0], linear[1], linear[2], angular[0], angular[1], angular[2])


@wp.func
def linear_part(v: vec6) -> wp.vec3:
    """First half of a move or wrench: displacement [µm] or force [pN]."""
    return wp.vec3(v[0], v[1], v[2])


@wp.func
def angular_part(v: vec6) -> wp.vec3:
    """Second half of a move or wrench: rotation vector [rad] or torque [pN·µm]."""
    return wp.vec3(v[3], v[4], v[5])


@wp.func
def symmetric_product(s: vec6, v: wp.vec3) -> wp.vec3:
    """S v of a symmetric matrix S kept as (xx, yy, zz, xy, xz, yz), in units of S times units of v."""
    return wp.vec3(
        s[0] * v[0] + s[3] * v[1] + s[4] * v[2],
        s[3] * v[0] + s[1] * v[1] + s[5] * v[2],
        s[4] * v[0] + s[5] * v[1] + s[2] * v[2],
    )


@wp.func
def lower_product(s: vec6, v: wp.vec3) -> wp.vec3:
    """L v of a lower triangle L kept as (xx, yy, zz, yx, zx, zy), in units of L times units of v."""
    return wp.vec3(s[0] * v[0], s[3] * v[0] + s[1] * v[1], s[4] * v[0] + s[5] * v[1] + s[2] * v[2])


@wp.func
def mobility_product(body: RigidConstants, pose: Pose, load: vec6) -> vec6:
    """M dt times a wrench [pN, pN·µm]: the move in one step [µm, rad], both in world axes."""
    turn = rotation_matrix(pose.rotation)
    back = wp.transpose(turn)
    f = back * linear_part(load)
    t = back * angular_part(load)
    v = symmetric_product(body.translation, f) + symmetric_product(body.coupling, t)
    w = symmetric_product(body.coupling, f) + symmetric_product(body.rotation, t)
    return twist(turn * v, turn * w)


def mobility_term(f: Features) -> wp.Function:
    """`(body, pose, load) -> twist`: M dt times a wrench, both in world axes."""

    @wp.func
    def from_columns(body: RigidConstants, pose: Pose, load: vec6) -> vec6:
        """M dt times a wrench [µm, rad] from the columns that `rigid_block` keeps, in the vector registers of a CPU."""
        return kept_mobility_product(body.kept, rotation_matrix(pose.rotation), load)

    return from_columns if f.lanes else mobility_product


def rigid_constants_term(f: Features) -> wp.Function:
    """`(model, control, world, b) -> RigidConstants`."""
    kept_aims = kept_aims_term(f) if f.keeps_aims else None

    @wp.func
    def packed(m: mat66, row: int, column: int, scale: float) -> vec6:
        """`scale` times the symmetric or lower triangular 3×3 block at (row, column): (xx, yy, zz, yx, zx, zy)."""
        return scale * vec6(
            m[row, column],
            m[row + 1, column + 1],
            m[row + 2, column + 2],
            m[row + 1, column],
            m[row + 2, column],
            m[row + 2, column + 1],
        )

    @wp.func
    def rigid_constants(model: ModelData, control: ControlData, world: int, b: int) -> RigidConstants:
        """Blocks of M dt and of the factor of the noise, as `RigidConstants`, body axes; also aims of traps at rest."""
        body = RigidConstants()
        shape = model.body.shape[b]
        scale = step_over_viscosity(model, world)
        m = mat66_at(model.body.mobility, shape)
        body.translation = packed(m, 0, 0, scale)
        body.coupling = packed(m, 3, 0, scale)
        body.rotation = packed(m, 3, 3, scale)
        if wp.static(f.brownian):
            energy = thermal_energy_of(model, world)
            spread = wp.sqrt(2.0 * energy * scale)
            root = model.body.cholesky[shape]
            body.translation_root = packed(root, 0, 0, spread)
            body.rotation_root = packed(root, 3, 3, spread)
            for i in range(3):
                for j in range(3):
                    body.coupling_root[i, j] = spread * root[i + 3, j]
            body.rotation_root = turning_root(body.coupling_root, body.rotation_root)
        if wp.static(f.listed):
            body.bound = model.body.bound[b]
        elif wp.static(f.keeps_aims):
            body = kept_aims(model, control, world, b, body)
        return body

    return rigid_constants


def flow_velocity_term(f: Features) -> wp.Function:
    """`(model, world, b, pose) -> twist` per second of a force-free body in the flow, world axes."""
    flow_at = FLOW_TERMS[f.flow]

    @wp.func
    def flow_velocity(model: ModelData, world: int, b: int, pose: Pose) -> vec6:
        """Twist of the force-free body [µm/s, rad/s]: mobility-weighted mean of the flow over its spheres."""
        velocity = vec6()
        for i in range(model.body.drag_start[b], model.body.drag_start[b + 1]):
            sphere = model.body.drag_sphere[i]
            point = pose.position + wp.quat_rotate(pose.rotation, point_of(sphere))
            u = flow_at(model.flow, world, point, radius_of(sphere))
            v = wp.quat_rotate_inv(pose.rotation, u.linear)
            w = wp.quat_rotate_inv(pose.rotation, u.angular)
            velocity += model.body.flow_coupling[i] * twist(v, w)
        return twist(
            wp.quat_rotate(pose.rotation, linear_part(velocity)), wp.quat_rotate(pose.rotation, angular_part(velocity))
        )

    return flow_velocity


def rigid_noise_term(f: Features) -> wp.Function:
    """`(model, body, world, b, pose, step) -> twist`: noise of a step, as `rotational_noise` says, from the factor of
    `RigidConstants`."""
    six_deviates = six_deviates_term(f.noise, f.fast_math)
    number = number_term(f)

    @wp.func
    def from_block(model: ModelData, body: RigidConstants, world: int, b: int, pose: Pose, step: wp.int64) -> vec6:
        """Thermal move [µm, rad] from a block of them in the body's frame, in the vector registers of a CPU."""
        return kick_at(body.kicks, rotation_matrix(pose.rotation), step)

    @wp.func
    def noise(model: ModelData, body: RigidConstants, world: int, b: int, pose: Pose, step: wp.int64) -> vec6:
        """Thermal move [µm, rad] in world axes by six deviates; 0 without noise."""
        kick = vec6()
        if wp.static(f.brownian):
            deviates = six_deviates(model.seed, step, number(model, world), b)
            first = linear_part(deviates)
            second = angular_part(deviates)
            v = lower_product(body.translation_root, first)
            w = body.coupling_root * first + lower_product(body.rotation_root, second)
            turn = rotation_matrix(pose.rotation)
            # turned in the body's frame: nothing then waits for where the body is
            kick = twist(turn * turned_along(v, w), turn * w)
        return kick

    return from_block if f.brownian and f.lanes else noise


def rigid_stiffness_term(f: Features) -> wp.Function:
    """`(model, control, state, body, world, b, pose, time) -> (6, 6)` [pN/µm, pN, pN·µm], in world axes."""
    of_forces = body_stiffness_total(f)

    @wp.func
    def stiffness(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> mat66:  # fmt: skip
        """Sum over `FORCES` [pN/µm, pN, pN·µm]; the constants of the body are not needed."""
        return of_forces(model, control, state, world, b, pose, time)

    return stiffness


def rigid_dynamics(f: Features) -> Dynamics:
    """Drift M (F, T) dt + flow and noise of a rigid body."""
    wrench = body_total(f)
    forced = bool(active_forces(f))
    flow_velocity = flow_velocity_term(f) if f.flow else None
    mobility = mobility_term(f)

    @wp.func
    def drift(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> vec6:  # fmt: skip
        """M (F, T) dt + flow [µm, rad] in world axes, (F, T) the sum over `FORCES`."""
        move = vec6()
        if wp.static(forced):
            load = wrench(model, control, state, body, world, b, pose, time)
            move = mobility(body, pose, twist(load.force, load.torque))
        if wp.static(f.flow is not None):
            move += wp.float32(model.time_step) * flow_velocity(model, world, b, pose)
        return move

    @wp.func
    def shifted(pose: Pose, move: vec6) -> Pose:
        """Pose after a move [µm, rad]: translation, and the exponential map of the rotation vector."""
        return Pose(pose.position + linear_part(move), rotate_by(pose.rotation, angular_part(move)))

    @wp.func
    def pulled_back(move: vec6, drift: vec6) -> vec6:
        """A drift found after `move` as it counts at its start [µm, rad]: inverse differential of the exponential map.

        To first order, for rotation vectors do not add (Iserles et al. 2000, doi:10.1017/S0962492900002154).
        """
        turn = angular_part(move)
        w = angular_part(drift)
        return twist(linear_part(drift), w - 0.5 * wp.cross(turn, w))

    @wp.func
    def relax(body: RigidConstants, pose: Pose, k: mat66, move: vec6) -> vec6:
        """Z v = M dt K v [µm, rad]: what the stiffness K pulls back of a move v in one step."""
        return mobility(body, pose, k * move)

    noise = rigid_noise_term(f)
    stiffness = rigid_stiffness_term(f)
    # on a CPU two copies of the drift are faster than a loop, and of that of a list
    large = bool(f.trap_models) and not (f.lanes or f.listed)
    return Dynamics(
        Pose, vec6, RigidConstants, mat66, drift, noise, shifted, pulled_back, stiffness, relax, f.leaps, large,
        strayed if f.listed else None,
    )  # fmt: skip
