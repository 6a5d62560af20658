"""Hydrodynamic walls: how a lone sphere moves and diffuses near no-slip planes.

The resistance of the sphere is that of the free one plus one excess per wall (`otwarp.laws.wall_fits`, evaluated here):

    R/6πηa = 1 + Σ_i [E⊥(g_i) n_i n_iᵀ + E∥(g_i)(1 − n_i n_iᵀ)],   μ = R⁻¹,   g_i = h_i/a − 1.

The mobility depends on where the sphere is, so the noise needs a drift of its own, k_B T ∇·μ dt, or the sphere would
pile up at the wall (Ermak & McCammon 1978, doi:10.1063/1.436761; Lau & Lubensky 2007, doi:10.1103/PhysRevE.76.011123).
As ∂μ = −μ ∂R μ, wall i contributes −μ R_i' μ n_i, with R_i' = ∂R_i/∂h: exact, no differences are taken. In each step
this drift is multiplied by ½(ξ_i² + ζ²), with ξ_i the step's own deviate along the wall's normal, scaled to unit
variance, and ζ an independent one. The factor has the mean 1. It is what Milstein's scheme wants, with ζ² in place of
1, and where the mobility is linear in the gap, as it is next to a wall, the step

    g → g + 2√g s ξ + s²(ξ² + ζ²) = (√g + sξ)² + s²ζ²

is the exact solution (the square of a two-dimensional Brownian motion) and cannot cross the wall, however long it is.

A sphere that does not collide with the wall and would cross it all the same is reflected: below `CONTACT_GAP` the
mobility is constant, and there reflection is what a hard wall does to diffusion.
"""

import dataclasses

import warp as wp

from otwarp.kernels.bodies.bead import bead_dynamics
from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.noise import WEAK_TERMS, high_half, six_deviates_term, three_deviates_term
from otwarp.kernels.core.packed import point_of, radius_of
from otwarp.kernels.core.random import GAUSSIAN_TERMS, Stream, noise_words
from otwarp.kernels.core.step_constants import BeadConstants
from otwarp.kernels.core.types import ControlData, ModelData, Move, Pose, StateData, WallData, vec6
from otwarp.kernels.core.worlds import number_term
from otwarp.laws.wall_fits import ENTRAINED, GAP_FAR, NORMAL, SLIDING, GapFit

_FAR = wp.constant(GAP_FAR)

NEAR_WALLS = ("heun", "eulerMaruyama")
"""Integrators that keep their meaning where the mobility depends on place, the one to fall back to first.

Averaging the deviates of two steps (Leimkuhler–Matthews) needs constant noise, and the exponential step a matrix of
relaxation that holds for the step. Heun's correction of the drift stays, with the noise and its thermal drift of weak
order 1.
"""

MOST_COEFFICIENTS = 7
"""Of a fit, numerator or denominator."""

_coefficients = wp.types.vector(length=MOST_COEFFICIENTS, dtype=wp.float32)


def fit_term(fit: GapFit) -> wp.Function:
    """`(gap) -> vec2(E, dE/dg)` of a fit; constant below its floor and beyond `GAP_FAR`."""
    above, below = fit.polynomials()
    top, bottom, floor = len(above), len(below), fit.floor
    numerator = _coefficients(*above, *([0.0] * (MOST_COEFFICIENTS - top)))
    denominator = _coefficients(*below, *([0.0] * (MOST_COEFFICIENTS - bottom)))

    @wp.func
    def excess(gap: float) -> wp.vec2:
        """E and dE/dg by Horner's rule, a pure number each; (N/D)' = (N' − (N/D) D')/D keeps clear of overflow."""
        g = wp.clamp(gap, wp.static(floor), _FAR)
        p = wp.static(numerator)
        q = wp.static(denominator)
        value = p[wp.static(top - 1)]
        value_slope = float(0.0)
        for k in range(wp.static(top - 1)):
            value_slope = value_slope * g + value
            value = value * g + p[wp.static(top - 2) - k]
        under = q[wp.static(bottom - 1)]
        under_slope = float(0.0)
        for k in range(wp.static(bottom - 1)):
            under_slope = under_slope * g + under
            under = under * g + q[wp.static(bottom - 2) - k]
        ratio = value / under
        slope = (value_slope - ratio * under_slope) / under
        return wp.vec2(ratio, wp.where(gap > wp.static(floor) and gap < _FAR, slope, 0.0))

    return excess


normal_excess = fit_term(NORMAL)
sliding_excess = fit_term(SLIDING)
entrained_excess = fit_term(ENTRAINED)


@wp.func
def height_above(walls: WallData, wall: int, point: wp.vec3) -> float:
    """Distance of a point from the plane [µm], negative inside the wall."""
    return wp.dot(walls.normal[wall], point) - walls.offset[wall]


@wp.func
def lower_root(m: wp.mat33) -> wp.mat33:
    """Lower Cholesky factor L, L Lᵀ = m, of a symmetric positive definite matrix."""
    l00 = wp.sqrt(m[0, 0])
    l10 = m[1, 0] / l00
    l20 = m[2, 0] / l00
    l11 = wp.sqrt(m[1, 1] - l10 * l10)
    l21 = (m[2, 1] - l20 * l10) / l11
    l22 = wp.sqrt(m[2, 2] - l20 * l20 - l21 * l21)
    return wp.mat33(l00, 0.0, 0.0, l10, l11, 0.0, l20, l21, l22)


@wp.func
def along_and_across(n: wp.vec3, along: float, across: float) -> wp.mat33:
    """across·n nᵀ + along·(1 − n nᵀ) for a unit normal n, in the units of its numbers."""
    return along * wp.identity(n=3, dtype=float) + (across - along) * wp.outer(n, n)


def sphere_mobility_term(f: Features) -> wp.Function:
    """`(walls, position, radius) -> mat33` μ/μ₀ of a lone sphere that is free to rotate."""

    @wp.func
    def near_one(walls: WallData, position: wp.vec3, radius: float) -> wp.mat33:
        """μ/μ₀ before one wall, whose axes are those of the mobility: no matrix is inverted."""
        gap = height_above(walls, 0, position) / radius - 1.0
        normal = normal_excess(gap)
        along = sliding_excess(gap)
        return along_and_across(walls.normal[0], 1.0 / (1.0 + along[0]), 1.0 / (1.0 + normal[0]))

    @wp.func
    def near_many(walls: WallData, position: wp.vec3, radius: float) -> wp.mat33:
        """μ/μ₀ = (1 + Σ excess resistances of the walls)⁻¹."""
        resistance = wp.identity(n=3, dtype=float)
        for wall in range(walls.normal.shape[0]):
            gap = height_above(walls, wall, position) / radius - 1.0
            resistance += along_and_across(walls.normal[wall], sliding_excess(gap)[0], normal_excess(gap)[0])
        return wp.inverse(resistance)

    return near_one if f.walls == 1 else near_many


def sphere_noise_term(f: Features) -> wp.Function:
    """`(walls, position, radius, spread, ξ, ζ) -> Δx`: noise and thermal drift of a lone sphere.

    `spread` = √(2 k_B T μ₀ dt) [µm]; ξ are three standard normal deviates and ζ a fourth.
    """
    mobility_of = sphere_mobility_term(f)

    @wp.func
    def near_one(
        walls: WallData, position: wp.vec3, radius: float, spread: float, kick: wp.vec3, fourth: float
    ) -> wp.vec3:
        """Noise and thermal drift [µm] before one wall, whose axes are those of the mobility."""
        n = walls.normal[0]
        gap = height_above(walls, 0, position) / radius - 1.0
        normal = normal_excess(gap)
        across = 1.0 / (1.0 + normal[0])
        along = 1.0 / (1.0 + sliding_excess(gap)[0])
        deviate = wp.dot(n, kick)
        # ½ spread² = k_B T μ₀ dt
        drift = -0.25 * spread * spread * across * across * normal[1] / radius * (deviate * deviate + fourth * fourth)
        noise = spread * (wp.sqrt(along) * (kick - deviate * n) + wp.sqrt(across) * deviate * n)
        return noise + drift * n

    @wp.func
    def near_many(
        walls: WallData, position: wp.vec3, radius: float, spread: float, kick: wp.vec3, fourth: float
    ) -> wp.vec3:
        """Noise and thermal drift [µm] before several walls, each with its own term of the drift."""
        mobility = mobility_of(walls, position, radius)
        noise = lower_root(mobility) * kick
        drift = wp.vec3(0.0)
        for wall in range(walls.normal.shape[0]):
            n = walls.normal[wall]
            gap = height_above(walls, wall, position) / radius - 1.0
            towards = mobility * n
            stiff = along_and_across(n, sliding_excess(gap)[1], normal_excess(gap)[1])
            deviate = wp.dot(n, noise)
            share = deviate * deviate / wp.dot(n, towards) + fourth * fourth
            drift += share * (stiff * towards)
        return spread * noise - (0.25 * spread * spread / radius) * (mobility * drift)

    return near_one if f.walls == 1 else near_many


def sphere_flow_term(f: Features) -> wp.Function:
    """`(walls, position, radius, mobility, flow, mean) -> velocity` of a lone sphere in a flow that stands at walls."""

    @wp.func
    def carried(
        walls: WallData, position: wp.vec3, radius: float, mobility: wp.mat33, flow: wp.vec3, mean: wp.vec3
    ) -> wp.vec3:
        """μ (ū + Σ_i E_i(1 − n_i n_iᵀ) u) [µm/s]: walls hold the sphere back more than they keep the flow from it.

        Without walls the sphere would have the mean ū of the flow over its surface; u is that at its centre.
        """
        pull = mean
        for wall in range(walls.normal.shape[0]):
            n = walls.normal[wall]
            gap = height_above(walls, wall, position) / radius - 1.0
            pull += entrained_excess(gap)[0] * (flow - wp.dot(n, flow) * n)
        return mobility * pull

    return carried


def more_deviates_term(f: Features) -> tuple[wp.Function, wp.Function]:
    """`(seed, step, world, body) -> vec4` for lone spheres, `-> (vec6, float)` for rigid bodies.

    One more than without walls; those that both have are the same.
    """
    if f.noise == "gaussian":
        pair = GAUSSIAN_TERMS[f.fast_math]

        @wp.func
        def four_gaussian(seed: wp.uint32, step: wp.int64, world: int, body: int) -> wp.vec4:
            """Four standard normal deviates; the first three are those of a free sphere."""
            words = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
            xy = pair(words[0], words[1])
            z = pair(words[2], words[3])
            return wp.vec4(xy[0], xy[1], z[0], z[1])

        @wp.func
        def seven_gaussian(seed: wp.uint32, step: wp.int64, world: int, body: int):
            """Six and one standard normal deviates; the six are those of a free body."""
            a = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
            c = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_B)), step, world, body)
            g0 = pair(a[0], a[1])
            g1 = pair(a[2], a[3])
            g2 = pair(c[0], c[1])
            g3 = pair(c[2], c[3])
            return vec6(g0[0], g0[1], g1[0], g1[1], g2[0], g2[1]), g3[0]

        return four_gaussian, seven_gaussian
    three_deviates, six_deviates = three_deviates_term(f.noise), six_deviates_term(f.noise)
    deviate = WEAK_TERMS[f.noise]

    @wp.func
    def four_weak(seed: wp.uint32, step: wp.int64, world: int, body: int) -> wp.vec4:
        """Four deviates of mean 0 and variance 1: those of a free sphere, and one from bits that they leave."""
        words = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
        xi = three_deviates(seed, step, world, body)
        return wp.vec4(xi[0], xi[1], xi[2], deviate(high_half(words[3])))

    @wp.func
    def seven_weak(seed: wp.uint32, step: wp.int64, world: int, body: int):
        """Six and one deviates of mean 0 and variance 1: those of a free body, and one from bits that they leave."""
        words = noise_words(seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, body)
        return six_deviates(seed, step, world, body), deviate(high_half(words[3]))

    return four_weak, seven_weak


def walled_bead_dynamics(f: Features) -> Dynamics:
    """Drift μ(x) F dt + flow and noise with its thermal drift of a lone sphere near walls."""
    free = bead_dynamics(dataclasses.replace(f, walls=0, flow=None))
    still = free.drift
    mobility_of = sphere_mobility_term(f)
    noise_of = sphere_noise_term(f)
    carried = sphere_flow_term(f)
    flow_at = FLOW_TERMS[f.flow] if f.flow else None
    four_deviates = more_deviates_term(f)[0]
    number = number_term(f)

    @wp.func
    def drift(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> wp.vec3:  # fmt: skip
        """μ(x) F dt + flow [µm] with the hindered mobility, F the sum over `FORCES`."""
        radius = radius_of(model.walls.sphere[model.walls.start[b]])
        mobility = mobility_of(model.walls, position, radius)
        move = mobility * still(model, control, state, bead, world, b, position, time)
        if wp.static(f.flow is not None):
            flow = flow_at(model.flow, world, position, 0.0).linear
            mean = flow_at(model.flow, world, position, radius).linear
            move += wp.float32(model.time_step) * carried(model.walls, position, radius, mobility, flow, mean)
        return move

    @wp.func
    def noise(model: ModelData, bead: BeadConstants, world: int, b: int, position: wp.vec3, step: wp.int64) -> wp.vec3:
        """√(2 k_B T μ dt) ξ + k_B T ∇·μ dt [µm] at `position`; 0 without noise."""
        kick = wp.vec3(0.0)
        if wp.static(f.brownian):
            radius = radius_of(model.walls.sphere[model.walls.start[b]])
            xi = four_deviates(model.seed, step, number(model, world), b)
            kick = noise_of(model.walls, position, radius, bead.spread, wp.vec3(xi[0], xi[1], xi[2]), xi[3])
        return kick

    # stiffness and relaxation of the free sphere would be wrong here; no scheme that asks for them is used near walls
    return dataclasses.replace(free, drift=drift, noise=noise, stiffness=None, relax=None)


def walled_sphere_response_term(f: Features) -> wp.Function:
    """`(model, b, pose, scale, arm, force) -> Move`: what a force moves in one step; `scale` = dt/η."""
    mobility_of = sphere_mobility_term(f)

    @wp.func
    def walled_sphere_response(
        model: ModelData, b: int, pose: Pose, scale: float, arm: wp.vec3, force: wp.vec3
    ) -> Move:
        """Displacement [µm] of the sphere by `force` [pN] acting for one step against the hindered mobility."""
        mobility = mobility_of(model.walls, pose.position, radius_of(model.walls.sphere[model.walls.start[b]]))
        return Move((scale * model.body.translation[model.body.shape[b]]) * (mobility * force), wp.vec3(0.0))

    return walled_sphere_response


@wp.func
def out_of_walls(walls: WallData, b: int, pose: Pose) -> wp.vec3:
    """Displacement [µm] that reflects a body off walls which its spheres have crossed, where no contact stops them."""
    shift = wp.vec3(0.0)
    for wall in range(walls.normal.shape[0]):
        n = walls.normal[wall]
        height = height_above(walls, wall, pose.position + shift)
        deepest = float(0.0)
        for s in range(walls.start[b], walls.start[b + 1]):
            if walls.turned_back[s] != 0:
                sphere = walls.sphere[s]
                arm = wp.quat_rotate(pose.rotation, point_of(sphere))
                deepest = wp.min(deepest, height + wp.dot(n, arm) - radius_of(sphere))
        shift -= 2.0 * deepest * n
    return shift


def sphere_dynamics(f: Features) -> Dynamics:
    """Dynamics of the lone spheres of a scene, with walls or without."""
    return walled_bead_dynamics(f) if f.walls else bead_dynamics(f)
