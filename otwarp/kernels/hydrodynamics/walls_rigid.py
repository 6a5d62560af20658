"""Hydrodynamic walls: how a rigid body of several spheres moves and diffuses near no-slip planes.

In the body's axes, with K_s the motion of sphere s (u = U + Ω × r_s) and n the normal of a wall,

    R = R_free + Σ_s,walls K_sᵀ ΔR_s(h_s, n) K_s,   M = R⁻¹ = L⁻ᵀL⁻¹,   noise √(2 k_B T dt/η) L⁻ᵀ ξ,

with L the Cholesky factor of R, found in registers. The thermal drift k_B T dt/η ∇·M is found exactly, not by random
differences (Delong, Balboa Usabiaga, Donev 2015, doi:10.1063/1.4932062) nor by a midpoint (Fixman 1978), which would
both want R and L a second time at a displaced pose, and whose differences float32 coordinates blur next to a wall.
Along the fields X_b that move and turn a body in its own axes, ∇·M = Σ_b X_b M e_b = −M Σ_b (X_b R) M e_b, where K_s
and R_free do not change; only h_s and n do. Each sphere and wall then contributes, with M_tr etc. the blocks of M,

    h:  K_sᵀ ΔR_s' K_s M w,   w = (n, r_s × n) the change of h_s per motion, times ½(ξ_h² + ζ²) as in `walls`;
    n:  K_sᵀ (f, t),   f = β[n × Pᵀn + n(n·ax P)] + b[Qn − n tr Q],   t = −b[Pᵀn − n tr P] + δ n × Qn,

where ΔR_s = [[αI + β nnᵀ, b[n]×], [·, γI + δ nnᵀ]], P = M_tr − [r_s]× M_rr, Q = M_rr and ax P = Σ_j e_j × P e_j. The
step moves and turns a body separately instead of along one screw, which misses ax(M_tr); it is added. It vanishes about
the centre of diffusion of the free body.
"""

import dataclasses

import warp as wp

from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.kernels.bodies.rigid import angular_part, flow_velocity_term, linear_part, rigid_dynamics, twist
from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.medium import step_over_viscosity, thermal_energy_of
from otwarp.kernels.core.packed import point_of, radius_of
from otwarp.kernels.core.rounding import PI
from otwarp.kernels.core.step_constants import RigidConstants
from otwarp.kernels.core.types import ControlData, ModelData, Move, Pose, StateData, WallData, mat66, vec6
from otwarp.kernels.core.worlds import number_term
from otwarp.kernels.forces.total import body_total
from otwarp.kernels.hydrodynamics.walls import fit_term, more_deviates_term, normal_excess
from otwarp.laws.wall_fits import COUPLING, PARALLEL, ROLL, SHEAR_FORCE, SHEAR_TORQUE, SPIN

parallel_excess = fit_term(PARALLEL)
roll_excess = fit_term(ROLL)
spin_excess = fit_term(SPIN)
coupling_excess = fit_term(COUPLING)
shear_force_excess = fit_term(SHEAR_FORCE)
shear_torque_lack = fit_term(SHEAR_TORQUE)


@wp.struct
class Friction:
    """Excess resistance of one sphere and one wall at unit viscosity, ΔR = [[αI + β nnᵀ, b[n]×], [·, γI + δ nnᵀ]]."""

    alpha: float  # [µm]
    beta: float
    b: float  # [µm²]
    gamma: float  # [µm³]
    delta: float


@wp.func
def friction(radius: float, normal: float, parallel: float, coupling: float, spin: float, roll: float) -> Friction:
    """Coefficients at unit viscosity [µm, µm², µm³] from excesses over the free sphere, or from their slopes."""
    a = 6.0 * PI * radius
    c = 8.0 * PI * radius * radius * radius
    return Friction(a * parallel, a * (normal - parallel), a * radius * coupling, c * roll, c * (spin - roll))


@wp.func
def frictions(gap: float, radius: float):
    """ΔR at unit viscosity and its slope dΔR/dh of a sphere of `radius` [µm] at `gap` = h/a − 1."""
    n = normal_excess(gap)
    p = parallel_excess(gap)
    c = coupling_excess(gap)
    s = spin_excess(gap)
    r = roll_excess(gap)
    value = friction(radius, n[0], p[0], c[0], s[0], r[0])
    per = 1.0 / radius
    return value, friction(radius, n[1] * per, p[1] * per, c[1] * per, s[1] * per, r[1] * per)


@wp.func
def rub(c: Friction, n: wp.vec3, arm: wp.vec3, motion: vec6) -> vec6:
    """Kᵀ ΔR u about the reference point, at unit viscosity, of a sphere at `arm` [µm] with the twist u = `motion`."""
    u = linear_part(motion)
    w = angular_part(motion)
    force = c.alpha * u + (c.beta * wp.dot(n, u)) * n + c.b * wp.cross(n, w)
    torque = c.gamma * w + (c.delta * wp.dot(n, w)) * n - c.b * wp.cross(n, u)
    return twist(force, torque + wp.cross(arm, force))


@wp.func
def motion_at(arm: wp.vec3, motion: vec6) -> vec6:
    """K u: twist of a sphere at `arm` [µm] of a body that moves with the twist u."""
    return twist(linear_part(motion) + wp.cross(angular_part(motion), arm), angular_part(motion))


@wp.func
def block(m: mat66, row: int, column: int) -> wp.mat33:
    """The 3×3 block of a 6×6 matrix whose upper left corner is at (row, column)."""
    out = wp.mat33(0.0)
    for i in range(3):
        for j in range(3):
            out[i, j] = m[row + i, column + j]
    return out


@wp.func
def curl(m: wp.mat33) -> wp.vec3:
    """ax m = Σ_j e_j × (m e_j): twice the axial vector of the antisymmetric part of m."""
    return wp.vec3(m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])


@wp.func
def inverse_root(r: mat66) -> mat66:
    """L⁻¹ of the Cholesky factor L of a symmetric positive definite matrix: r⁻¹ = L⁻ᵀ L⁻¹, lower triangular."""
    root = mat66(0.0)
    for i in range(6):
        for j in range(i):
            v = r[i, j]
            for k in range(j):
                v -= root[i, k] * root[j, k]
            root[i, j] = v * root[j, j]
        d = r[i, i]
        for k in range(i):
            d -= root[i, k] * root[i, k]
        # the diagonal is kept inverted: it only ever divides
        root[i, i] = 1.0 / wp.sqrt(d)
    out = mat66(0.0)
    for j in range(6):
        out[j, j] = root[j, j]
        for i in range(j + 1, 6):
            v = float(0.0)
            for k in range(j, i):
                v -= root[i, k] * out[k, j]
            out[i, j] = v * root[i, i]
    return out


@wp.func
def upper_product(m: mat66, v: vec6) -> vec6:
    """mᵀ v of a lower triangle m, products with its zeros left out."""
    out = vec6()
    for i in range(6):
        for j in range(i, 6):
            out[i] += m[j, i] * v[j]
    return out


@wp.func
def lower_times(m: mat66, v: vec6) -> vec6:
    """m v of a lower triangle m, products with its zeros left out."""
    out = vec6()
    for i in range(6):
        for j in range(i + 1):
            out[i] += m[i, j] * v[j]
    return out


def body_root_term(f: Features) -> wp.Function:
    """`(free, walls, b, pose) -> L⁻¹` of a body's resistance at its present place, body axes, unit viscosity.

    `free` is its resistance far from walls.
    """

    @wp.func
    def body_root(free: mat66, walls: WallData, b: int, pose: Pose) -> mat66:
        """R_free + Σ KᵀΔRK, multiplied out; its lower triangle is all that the factorisation reads."""
        r = free
        one = wp.identity(n=3, dtype=float)
        for wall in range(walls.normal.shape[0]):
            n = wp.quat_rotate_inv(pose.rotation, walls.normal[wall])
            height = wp.dot(walls.normal[wall], pose.position) - walls.offset[wall]
            for s in range(walls.start[b], walls.start[b + 1]):
                sphere = walls.sphere[s]
                arm = point_of(sphere)
                rise = wp.dot(n, arm)
                c, _ = frictions((height + rise) / radius_of(sphere) - 1.0, radius_of(sphere))
                m = wp.cross(arm, n)
                nn = wp.outer(n, n)
                tt = c.alpha * one + c.beta * nn
                rt = c.alpha * wp.skew(arm) - c.b * wp.skew(n) + c.beta * wp.outer(m, n)
                rr = (c.gamma - 2.0 * c.b * rise + c.alpha * wp.dot(arm, arm)) * one + c.delta * nn
                rr += (
                    c.b * (wp.outer(arm, n) + wp.outer(n, arm)) - c.alpha * wp.outer(arm, arm) + c.beta * wp.outer(m, m)
                )
                for i in range(3):
                    for j in range(3):
                        r[3 + i, j] = r[3 + i, j] + rt[i, j]
                        if j <= i:
                            r[i, j] = r[i, j] + tt[i, j]
                            r[3 + i, 3 + j] = r[3 + i, 3 + j] + rr[i, j]
        return inverse_root(r)

    return body_root


def body_noise_term(f: Features) -> wp.Function:
    """`(walls, b, pose, L⁻¹, spread, ξ, ζ) -> twist`: noise and thermal drift of a rigid body, body axes.

    `spread` = √(2 k_B T dt/η); ξ are six standard normal deviates and ζ a seventh.
    """

    @wp.func
    def turning(c: Friction, n: wp.vec3, arm: wp.vec3, p: wp.mat33, q: wp.mat33) -> vec6:
        """Kᵀ(f, t): what the turning of the normal in the body's axes contributes to Σ_b (X_b R) M e_b."""
        pn = wp.transpose(p) * n
        qn = q * n
        force = c.beta * (wp.cross(n, pn) + wp.dot(n, curl(p)) * n) + c.b * (qn - wp.trace(q) * n)
        torque = c.delta * wp.cross(n, qn) - c.b * (pn - wp.trace(p) * n)
        return twist(force, torque + wp.cross(arm, force))

    @wp.func
    def body_noise(walls: WallData, b: int, pose: Pose, root: mat66, spread: float, kick: vec6, seventh: float) -> vec6:
        """√(2 k_B T dt/η) L⁻ᵀ ξ + k_B T dt/η ∇·M [µm, rad], body axes."""
        mobility = wp.transpose(root) * root
        noise = upper_product(root, kick)
        coupling = block(mobility, 0, 3)
        q = block(mobility, 3, 3)
        total = vec6()
        for wall in range(walls.normal.shape[0]):
            n = wp.quat_rotate_inv(pose.rotation, walls.normal[wall])
            height = wp.dot(walls.normal[wall], pose.position) - walls.offset[wall]
            for s in range(walls.start[b], walls.start[b + 1]):
                sphere = walls.sphere[s]
                arm = point_of(sphere)
                gap = (height + wp.dot(n, arm)) / radius_of(sphere) - 1.0
                along = twist(n, wp.cross(arm, n))
                towards = mobility * along
                deviate = wp.dot(along, noise)
                share = 0.5 * (deviate * deviate / wp.dot(along, towards) + seventh * seventh)
                value, slope = frictions(gap, radius_of(sphere))
                total += share * rub(slope, n, arm, motion_at(arm, towards))
                total += turning(value, n, arm, coupling - wp.skew(arm) * q, q)
        drift = twist(curl(coupling), wp.vec3(0.0)) - mobility * total
        return spread * noise + (0.5 * spread * spread) * drift

    return body_noise


def body_flow_term(f: Features) -> wp.Function:
    """`(model, world, b, pose, L⁻¹) -> twist` per second of a force-free body in a flow that stands at the walls."""
    flow_at = FLOW_TERMS[f.flow]
    free_velocity = flow_velocity_term(f)

    @wp.func
    def carried(model: ModelData, world: int, b: int, pose: Pose, root: mat66) -> vec6:
        """M (R_free U_free + Σ_s Kᵀ (what walls add to force and torque of the flow on s)) [µm/s, rad/s], body axes."""
        free = free_velocity(model, world, b, pose)
        v = wp.quat_rotate_inv(pose.rotation, linear_part(free))
        w = wp.quat_rotate_inv(pose.rotation, angular_part(free))
        pull = model.body.resistance[model.body.shape[b]] * twist(v, w)
        for wall in range(model.walls.normal.shape[0]):
            n = model.walls.normal[wall]
            height = wp.dot(n, pose.position) - model.walls.offset[wall]
            for s in range(model.walls.start[b], model.walls.start[b + 1]):
                sphere = model.walls.sphere[s]
                radius = radius_of(sphere)
                arm = wp.quat_rotate(pose.rotation, point_of(sphere))
                gap = (height + wp.dot(n, arm)) / radius - 1.0
                flow = flow_at(model.flow, world, pose.position + arm, 0.0)
                more = 6.0 * PI * radius * shear_force_excess(gap)[0]
                less = 8.0 * PI * radius * radius * radius * shear_torque_lack(gap)[0]
                force = more * (flow.linear - wp.dot(n, flow.linear) * n)
                torque = wp.cross(arm, force) - less * (flow.angular - wp.dot(n, flow.angular) * n)
                pull += twist(wp.quat_rotate_inv(pose.rotation, force), wp.quat_rotate_inv(pose.rotation, torque))
        return upper_product(root, lower_times(root, pull))

    return carried


def walled_rigid_dynamics(f: Features) -> Dynamics:
    """Drift M(x) (F, T) dt + flow and noise with its thermal drift of a rigid body near walls."""
    free = rigid_dynamics(dataclasses.replace(f, walls=0, flow=None))
    wrench = body_total(f)
    root_of = body_root_term(f)
    noise_of = body_noise_term(f)
    flow_velocity = body_flow_term(f) if f.flow else None
    seven_deviates = more_deviates_term(f)[1]
    number = number_term(f)

    @wp.func
    def drift(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> vec6:  # fmt: skip
        """M(x) (F, T) dt + flow [µm, rad] in world axes, (F, T) the sum over `FORCES`."""
        root = root_of(model.body.resistance[model.body.shape[b]], model.walls, b, pose)
        load = wrench(model, control, state, body, world, b, pose, time)
        force = wp.quat_rotate_inv(pose.rotation, load.force)
        torque = wp.quat_rotate_inv(pose.rotation, load.torque)
        move = step_over_viscosity(model, world) * upper_product(root, lower_times(root, twist(force, torque)))
        if wp.static(f.flow is not None):
            move += wp.float32(model.time_step) * flow_velocity(model, world, b, pose, root)
        return twist(
            wp.quat_rotate(pose.rotation, linear_part(move)), wp.quat_rotate(pose.rotation, angular_part(move))
        )

    @wp.func
    def noise(model: ModelData, body: RigidConstants, world: int, b: int, pose: Pose, step: wp.int64) -> vec6:
        """√(2 k_B T dt) noise of M(x) and its thermal drift k_B T ∇·M dt [µm, rad] in world axes; 0 without noise."""
        kick = vec6()
        if wp.static(f.brownian):
            xi, seventh = seven_deviates(model.seed, step, number(model, world), b)
            energy = thermal_energy_of(model, world)
            spread = wp.sqrt(2.0 * energy * step_over_viscosity(model, world))
            root = root_of(model.body.resistance[model.body.shape[b]], model.walls, b, pose)
            move = noise_of(model.walls, b, pose, root, spread, xi, seventh)
            kick = twist(
                wp.quat_rotate(pose.rotation, linear_part(move)), wp.quat_rotate(pose.rotation, angular_part(move))
            )
        return kick

    # stiffness and relaxation of the free body would be wrong here; no scheme that asks for them is used near walls
    return dataclasses.replace(free, drift=drift, noise=noise, stiffness=None, relax=None)


def walled_rigid_response_term(f: Features) -> wp.Function:
    """`(model, b, pose, scale, arm, force) -> Move`: what a force at `arm` moves in one step; `scale` = dt/η."""
    root_of = body_root_term(f)

    @wp.func
    def walled_rigid_response(model: ModelData, b: int, pose: Pose, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
        """Move [µm, rad] of the body by `force` [pN] at `arm` [µm] for one step against the hindered mobility."""
        root = root_of(model.body.resistance[model.body.shape[b]], model.walls, b, pose)
        f_body = wp.quat_rotate_inv(pose.rotation, force)
        t_body = wp.quat_rotate_inv(pose.rotation, wp.cross(arm, force))
        move = scale * upper_product(root, lower_times(root, twist(f_body, t_body)))
        return Move(wp.quat_rotate(pose.rotation, linear_part(move)), wp.quat_rotate(pose.rotation, angular_part(move)))

    return walled_rigid_response


def turning_dynamics(f: Features) -> Dynamics:
    """Dynamics of the rigid bodies of a scene, with walls or without."""
    return walled_rigid_dynamics(f) if f.walls else rigid_dynamics(f)
