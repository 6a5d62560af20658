"""A lone sphere: its constants, the force on it, and how it drifts and diffuses in one step."""

import warp as wp

from otwarp.kernels.bodies.flow import FLOW_TERMS
from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.features import FEW_TRAPS, Features
from otwarp.kernels.core.noise import three_deviates_term
from otwarp.kernels.core.types import BeadConstants, ControlData, ModelData, StateData, TrapConstants, world_row
from otwarp.kernels.cpu.noise_block import three_at
from otwarp.kernels.optics.trap_wrench import anchor_of, reach_term, trap_command_term
from otwarp.kernels.optics.traps import commanded_still, trap_force_term


def bead_constants_term(f: Features) -> wp.Function:
    """`(model, control, world, b) -> BeadConstants` of a lone sphere."""
    prepare = trap_force_term(f.trap_models).prepare if f.trap_models else None

    @wp.func
    def bead_constants(model: ModelData, control: ControlData, world: int, b: int) -> BeadConstants:
        """Mobility, thermal spread, and the traps if they are few."""
        bead = BeadConstants()
        dt = wp.float32(model.time_step)
        viscosity = model.medium.viscosity[world_row(model.medium.viscosity.shape[0], world)]
        bead.mobility_dt = model.body.translation[model.body.shape[b]] / viscosity * dt
        if wp.static(f.brownian):
            energy = model.medium.thermal_energy[world_row(model.medium.thermal_energy.shape[0], world)]
            bead.spread = wp.sqrt(2.0 * energy * bead.mobility_dt)
        if wp.static(f.gravity):
            bead.weight = model.body.weight[b]
        if wp.static(bool(f.trap_models)):
            element = model.body.trapped_start[b]
            if element < model.body.trapped_start[b + 1]:
                bead.trapped = 1
                bead.radius = model.body.trapped[element][3]
                bead.kind = model.body.trapped_kind[element]
                if wp.static(f.traps <= FEW_TRAPS):
                    bead.first = prepare(model.traps, world, 0, bead.radius, bead.kind)
                    if wp.static(f.still_traps):
                        bead.first_command = commanded_still(model.traps, control, world, 0, wp.float64(0.0))
                if wp.static(f.traps == FEW_TRAPS):
                    bead.second = prepare(model.traps, world, 1, bead.radius, bead.kind)
                    if wp.static(f.still_traps):
                        bead.second_command = commanded_still(model.traps, control, world, 1, wp.float64(0.0))
        return bead

    return bead_constants


@wp.func
def no_force() -> wp.vec3:
    """Zero."""
    return wp.vec3(0.0)


@wp.func
def no_stiffness() -> wp.mat33:
    """Zero."""
    return wp.mat33(0.0)


def sum_over_traps_term(f: Features, what: str) -> wp.Function:
    """`(model, control, state, bead, world, b, position, time)` → sum over the traps of their `force` or `stiffness`.

    Args:
        what: Name of the function of `TrapTerm`, [pN] or [pN/µm] once the power is in.
    """
    term = trap_force_term(f.trap_models)
    prepare, value_at = term.prepare, getattr(term, what)
    kind, nothing = {"force": (wp.vec3, no_force), "stiffness": (wp.mat33, no_stiffness)}[what]
    trap_command = trap_command_term(f)
    reach_of = reach_term(f)

    @wp.func
    def one_of_few(model: ModelData, law: TrapConstants, command: wp.vec4, position: wp.vec3) -> kind:
        """Of a prepared trap."""
        anchor = wp.vec3(command[0], command[1], command[2]) + law.equilibrium * law.axis
        return command[3] * value_at(model.traps, law, position - anchor)

    @wp.func
    def of_few(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> kind:  # fmt: skip
        """Traps whose constants the sphere carries along."""
        command = bead.first_command
        if wp.static(not f.still_traps):
            command = trap_command(model, control, state, world, 0, time)
        total = one_of_few(model, bead.first, command, position)
        if wp.static(f.traps == FEW_TRAPS):
            other = bead.second_command
            if wp.static(not f.still_traps):
                other = trap_command(model, control, state, world, 1, time)
            total += one_of_few(model, bead.second, other, position)
        return total

    @wp.func
    def of_many(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> kind:  # fmt: skip
        """A loop over those within reach."""
        total = nothing()
        traps = int(wp.static(f.traps))
        for trap in range(traps):
            now = trap_command(model, control, state, world, trap, time)
            away = position - anchor_of(model, trap, now)
            reach = reach_of(model, world, trap, bead.radius)
            if wp.length_sq(away) < reach * reach:
                law = prepare(model.traps, world, trap, bead.radius, bead.kind)
                total += now[3] * value_at(model.traps, law, away)
        return total

    return of_few if f.traps <= FEW_TRAPS else of_many


def bead_noise_term(f: Features) -> wp.Function:
    """`(model, bead, world, b, position, step) -> kick`: √(2 k_B T μ dt) ξ."""
    three_deviates = three_deviates_term(f.noise, f.fast_math)

    @wp.func
    def noise(model: ModelData, bead: BeadConstants, world: int, b: int, position: wp.vec3, step: wp.int64) -> wp.vec3:
        """Three deviates."""
        kick = wp.vec3(0.0)
        if wp.static(f.brownian and f.lanes):
            kick = bead.spread * three_at(bead.deviates, int(step - bead.deviates_from))
        if wp.static(f.brownian and not f.lanes):
            kick = bead.spread * three_deviates(model.seed, step, world, b)
        return kick

    return noise


def bead_dynamics(f: Features) -> Dynamics:
    """Drift μ F dt + u dt and noise √(2 k_B T μ dt) ξ of a lone sphere."""
    force_of_traps = sum_over_traps_term(f, "force") if f.trap_models else None
    stiffness_of_traps = sum_over_traps_term(f, "stiffness") if f.trap_models else None
    flow_at = FLOW_TERMS[f.flow] if f.flow else None

    @wp.func
    def drift(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> wp.vec3:  # fmt: skip
        """Traps, weight and flow."""
        force = wp.vec3(0.0)
        if wp.static(bool(f.trap_models)):
            if bead.trapped != 0:
                force = force_of_traps(model, control, state, bead, world, b, position, time)
        if wp.static(f.gravity):
            force += wp.vec3(0.0, 0.0, -bead.weight)
        move = bead.mobility_dt * force
        if wp.static(f.flow is not None):
            move += wp.float32(model.time_step) * flow_at(model.flow, world, position).linear
        return move

    @wp.func
    def shifted(position: wp.vec3, move: wp.vec3) -> wp.vec3:
        """Space is flat."""
        return position + move

    @wp.func
    def pulled_back(move: wp.vec3, drift: wp.vec3) -> wp.vec3:
        """Space is flat."""
        return drift

    @wp.func
    def stiffness(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> wp.mat33:  # fmt: skip
        """That of the traps."""
        k = wp.mat33(0.0)
        if wp.static(bool(f.trap_models)):
            if bead.trapped != 0:
                k = stiffness_of_traps(model, control, state, bead, world, b, position, time)
        return k

    @wp.func
    def relax(bead: BeadConstants, position: wp.vec3, k: wp.mat33, move: wp.vec3) -> wp.vec3:
        """μ dt K v."""
        return bead.mobility_dt * (k * move)

    noise = bead_noise_term(f)
    return Dynamics(wp.vec3, wp.vec3, BeadConstants, wp.mat33, drift, noise, shifted, pulled_back, stiffness, relax)
