"""A lone sphere: its constants, the force on it, and how it drifts and diffuses in one step."""

import warp as wp

from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.features import FEW_TRAPS, Features
from otwarp.kernels.core.medium import thermal_energy_of, viscosity_of
from otwarp.kernels.core.noise import three_deviates_term
from otwarp.kernels.core.packed import radius_of
from otwarp.kernels.core.rounding import PI
from otwarp.kernels.core.step_constants import BeadConstants
from otwarp.kernels.core.types import ControlData, ModelData, StateData
from otwarp.kernels.core.worlds import number_term
from otwarp.kernels.cpu.noise_block import three_at
from otwarp.kernels.forces.total import sphere_total
from otwarp.kernels.optics.traps import anchored, commanded_still, glide_of, trap_force_term


def bead_constants_term(f: Features) -> wp.Function:
    """`(model, control, world, b) -> BeadConstants` of a lone sphere."""
    # in one function: a struct that goes from row to row of `FORCES` is copied, which doubled a CPU's step
    prepare = trap_force_term(f.trap_models).prepare if f.trap_models else None

    @wp.func
    def bead_constants(model: ModelData, control: ControlData, world: int, b: int) -> BeadConstants:
        """μ dt [µm/pN], thermal spread √(2 k_B T μ dt) [µm], weight [pN], and the constants of at most two traps."""
        bead = BeadConstants()
        dt = wp.float32(model.time_step)
        viscosity = viscosity_of(model, world)
        translation = model.body.translation[model.body.shape[b]]
        bead.mobility_dt = translation / viscosity * dt
        if wp.static(f.flow is not None):
            bead.drag_radius = 1.0 / (6.0 * PI * translation)
        if wp.static(f.brownian):
            energy = thermal_energy_of(model, world)
            bead.spread = wp.sqrt(2.0 * energy * bead.mobility_dt)
        if wp.static(f.gravity):
            bead.weight = model.body.weight[b]
        if wp.static(bool(f.trap_models)):
            element = model.body.trapped_start[b]
            if element < model.body.trapped_start[b + 1]:
                bead.trapped = 1
                bead.radius = radius_of(model.body.trapped[element])
                bead.kind = model.body.trapped_kind[element]
                if wp.static(f.traps <= FEW_TRAPS):
                    bead.first = prepare(model.traps, world, 0, bead.radius, bead.kind)
                    bead.first_anchor = commanded_still(model.traps, control, world, 0, wp.float64(0.0))
                    if wp.static(f.gliding_traps):
                        bead.first_glide = glide_of(control, world, 0)
                    if wp.static(f.still_traps):
                        bead.first_anchor = anchored(bead.first, bead.first_anchor)
                if wp.static(f.traps == FEW_TRAPS):
                    bead.second = prepare(model.traps, world, 1, bead.radius, bead.kind)
                    bead.second_anchor = commanded_still(model.traps, control, world, 1, wp.float64(0.0))
                    if wp.static(f.gliding_traps):
                        bead.second_glide = glide_of(control, world, 1)
                    if wp.static(f.still_traps):
                        bead.second_anchor = anchored(bead.second, bead.second_anchor)
        return bead

    return bead_constants


def bead_noise_term(f: Features) -> wp.Function:
    """`(model, bead, world, b, position, step) -> kick`: √(2 k_B T μ dt) ξ."""
    three_deviates = three_deviates_term(f.noise, f.fast_math)
    number = number_term(f)

    @wp.func
    def noise(model: ModelData, bead: BeadConstants, world: int, b: int, position: wp.vec3, step: wp.int64) -> wp.vec3:
        """Thermal displacement √(2 k_B T μ dt) ξ [µm], ξ three deviates; 0 without noise."""
        kick = wp.vec3(0.0)
        if wp.static(f.draws_blocks):
            kick = bead.spread * three_at(bead.deviates, step)
        if wp.static(f.brownian and not f.draws_blocks):
            kick = bead.spread * three_deviates(model.seed, step, number(model, world), b)
        return kick

    return noise


def bead_dynamics(f: Features) -> Dynamics:
    """Drift μ F dt + u dt and noise √(2 k_B T μ dt) ξ of a lone sphere."""
    force_on = sphere_total(f, "force")
    stiffness = sphere_total(f, "stiffness")
    flow_at = FLOW_TERMS[f.flow] if f.flow else None

    @wp.func
    def drift(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> wp.vec3:  # fmt: skip
        """μ F dt + u dt [µm], F the sum over `FORCES`."""
        move = bead.mobility_dt * force_on(model, control, state, bead, world, b, position, time)
        if wp.static(f.flow is not None):
            move += wp.float32(model.time_step) * flow_at(model.flow, world, position, bead.drag_radius).linear
        return move

    @wp.func
    def shifted(position: wp.vec3, move: wp.vec3) -> wp.vec3:
        """Position after a move [µm]: places and displacements of a sphere add."""
        return position + move

    @wp.func
    def pulled_back(move: wp.vec3, drift: wp.vec3) -> wp.vec3:
        """A drift found after `move` as it counts at its start [µm]: the same, for displacements commute."""
        return drift

    @wp.func
    def relax(bead: BeadConstants, position: wp.vec3, k: wp.mat33, move: wp.vec3) -> wp.vec3:
        """Z v = μ dt K v [µm]: what a spring K [pN/µm] pulls back of a displacement v in one step."""
        return bead.mobility_dt * (k * move)

    noise = bead_noise_term(f)
    return Dynamics(
        wp.vec3, wp.vec3, BeadConstants, wp.mat33, drift, noise, shifted, pulled_back, stiffness, relax, f.leaps
    )
