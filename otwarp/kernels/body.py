"""One body, one step, before contact: the wrench that acts on it and how far it moves freely."""

import warp as wp

from otwarp.kernels.features import Features
from otwarp.kernels.flow import FLOW_TERMS
from otwarp.kernels.random import GAUSSIAN_TERMS, Stream, noise_words
from otwarp.kernels.traps import commanded_animated, commanded_still, limited_focus, trap_force_term
from otwarp.kernels.types import (
    BeadConstants,
    BodyData,
    ControlData,
    ModelData,
    Move,
    Pose,
    StateData,
    TrapConstants,
    Wrench,
    vec6,
    world_row,
)

FEW_TRAPS = 2
"""Up to this many traps a lone sphere carries their constants along; beyond, they are read at the point of use."""


def trap_command_term(f: Features) -> wp.Function:
    """`(model, control, state, world, trap, time) -> vec4(focus, power)`: where the trap is now."""
    commanded = commanded_animated if f.moving_traps else commanded_still

    @wp.func
    def trap_command(
        model: ModelData, control: ControlData, state: StateData, world: int, trap: int, time: wp.float64
    ) -> wp.vec4:
        """Focus as commanded, or as far as the speed limit let it come, and power."""
        command = commanded(model.traps, control, world, trap, time)
        if wp.static(f.speed_limits):
            p = state.trap_position[world, trap]
            command = wp.vec4(p[0], p[1], p[2], command[3])
        return command

    return trap_command


def move_trap_term(f: Features) -> wp.Function:
    """`(model, control, state, world, trap, time)`: move a focus one step towards its command, as fast as it may."""
    commanded = commanded_animated if f.moving_traps else commanded_still

    @wp.func
    def move_trap(model: ModelData, control: ControlData, state: StateData, world: int, trap: int, time: wp.float64):
        """Write the new focus to `state.trap_position`."""
        wanted = commanded(model.traps, control, world, trap, time)
        now = state.trap_position[world, trap]
        dt = wp.float32(model.time_step)
        goal = wp.vec3(wanted[0], wanted[1], wanted[2])
        state.trap_position[world, trap] = limited_focus(model.traps, world, trap, now, goal, dt)

    return move_trap


def trap_wrench_term(f: Features) -> wp.Function:
    """`(model, world, b, pose, trap, command) -> Wrench`: what one trap does to a body (the sum of MSDM, eq. 2)."""
    prepare, trap_force = trap_force_term(f.trap_models)
    within_reach = reach_term(f)

    @wp.func
    def on_body(model: ModelData, world: int, b: int, pose: Pose, trap: int, command: wp.vec4) -> Wrench:
        """Force and torque summed over its trapped spheres."""
        total = Wrench(wp.vec3(0.0), wp.vec3(0.0))
        anchor = anchor_of(model, trap, command)
        if within_reach(model, world, b, trap, pose.position - anchor):
            for element in range(model.body.trapped_start[b], model.body.trapped_start[b + 1]):
                sphere = model.body.trapped[element]
                arm = wp.quat_rotate(pose.rotation, wp.vec3(sphere[0], sphere[1], sphere[2]))
                displacement = pose.position + arm - anchor
                law = prepare(model.traps, world, trap, sphere[3], model.body.trapped_kind[element])
                force = command[3] * trap_force(model.traps, law, displacement)
                total.force += force
                total.torque += wp.cross(arm, force)
        return total

    return on_body


@wp.func
def anchor_of(model: ModelData, trap: int, command: wp.vec4) -> wp.vec3:
    """Equilibrium point of a trap whose focus is commanded to be there [µm]."""
    return wp.vec3(command[0], command[1], command[2]) + model.traps.equilibrium[trap] * model.traps.axis[trap]


def reach_term(f: Features) -> wp.Function:
    """`(model, world, b, trap, displacement) -> bool`: a trap that cannot reach a body costs one distance."""
    split = any(m.endswith("split") for m in f.trap_models)

    @wp.func
    def within_reach(model: ModelData, world: int, b: int, trap: int, displacement: wp.vec3) -> bool:
        """Whether the largest cutoff, for the largest sphere, touches the bounding sphere."""
        reach = model.traps.cutoff[world_row(model.traps.cutoff.shape[0], world), trap]
        if wp.static(split):
            axial = model.traps.axial_cutoff[world_row(model.traps.axial_cutoff.shape[0], world), trap]
            reach = wp.max(reach, axial)
        if model.traps.law_radius[trap] > 0.0:
            reach *= model.body.largest[b] / model.traps.law_radius[trap]
        return wp.length(displacement) < reach + model.body.bound[b]

    return within_reach


def wrench_term(f: Features) -> wp.Function:
    """`(model, control, state, world, b, pose, time) -> Wrench`: all forces on a body that are not contact."""
    trap_command = trap_command_term(f)
    trap_wrench = trap_wrench_term(f) if f.trap_models else None

    @wp.func
    def wrench(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, pose: Pose, time: wp.float64
    ) -> Wrench:
        """Traps one by one, then weight, which acts at the centroid."""
        total = Wrench(wp.vec3(0.0), wp.vec3(0.0))
        if wp.static(bool(f.trap_models)):
            traps = int(wp.static(f.traps))
            for trap in range(traps):
                one = trap_wrench(model, world, b, pose, trap, trap_command(model, control, state, world, trap, time))
                total.force += one.force
                total.torque += one.torque
        if wp.static(f.gravity):
            load = wp.vec3(0.0, 0.0, -model.body.weight[b])
            total.force += load
            total.torque += wp.cross(wp.quat_rotate(pose.rotation, model.body.weight_arm[b]), load)
        return total

    return wrench


def bead_constants_term(f: Features) -> wp.Function:
    """`(model, control, world, b) -> BeadConstants` of a lone sphere."""
    prepare = trap_force_term(f.trap_models)[0] if f.trap_models else None

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


def bead_force_term(f: Features) -> wp.Function:
    """`(model, control, state, bead, world, b, position, time) -> force` of the traps on a lone sphere [pN]."""
    prepare, trap_force = trap_force_term(f.trap_models)
    trap_command = trap_command_term(f)
    within_reach = reach_term(f)

    @wp.func
    def one_of_few(model: ModelData, law: TrapConstants, command: wp.vec4, position: wp.vec3) -> wp.vec3:
        """Force of a prepared trap."""
        anchor = wp.vec3(command[0], command[1], command[2]) + law.equilibrium * law.axis
        return command[3] * trap_force(model.traps, law, position - anchor)

    @wp.func
    def bead_force(
        model: ModelData,
        control: ControlData,
        state: StateData,
        bead: BeadConstants,
        world: int,
        b: int,
        position: wp.vec3,
        time: wp.float64,
    ) -> wp.vec3:
        """Prepared traps, or a loop over many."""
        force = wp.vec3(0.0)
        if wp.static(f.traps <= FEW_TRAPS):
            command = bead.first_command
            if wp.static(not f.still_traps):
                command = trap_command(model, control, state, world, 0, time)
            force = one_of_few(model, bead.first, command, position)
            if wp.static(f.traps == FEW_TRAPS):
                other = bead.second_command
                if wp.static(not f.still_traps):
                    other = trap_command(model, control, state, world, 1, time)
                force += one_of_few(model, bead.second, other, position)
        else:
            traps = int(wp.static(f.traps))
            for trap in range(traps):
                now = trap_command(model, control, state, world, trap, time)
                away = position - anchor_of(model, trap, now)
                if within_reach(model, world, b, trap, away):
                    law = prepare(model.traps, world, trap, bead.radius, bead.kind)
                    force += now[3] * trap_force(model.traps, law, away)
        return force

    return bead_force


def bead_move_term(f: Features) -> wp.Function:
    """`(model, control, state, bead, world, b, position, step, time) -> Δx` of a lone sphere [µm].

    Δx = μ F dt + √(2 k_B T μ dt) ξ + u dt.
    """
    bead_force = bead_force_term(f) if f.trap_models else None
    flow_at = FLOW_TERMS[f.flow] if f.flow else None
    gaussian = GAUSSIAN_TERMS[f.fast_math]

    @wp.func
    def bead_move(
        model: ModelData,
        control: ControlData,
        state: StateData,
        bead: BeadConstants,
        world: int,
        b: int,
        position: wp.vec3,
        step: wp.int64,
        time: wp.float64,
    ) -> wp.vec3:
        """Drift, noise and advection of a sphere."""
        force = wp.vec3(0.0)
        if wp.static(bool(f.trap_models)):
            if bead.trapped != 0:
                force = bead_force(model, control, state, bead, world, b, position, time)
        if wp.static(f.gravity):
            force += wp.vec3(0.0, 0.0, -bead.weight)
        move = bead.mobility_dt * force
        if wp.static(f.brownian):
            words = noise_words(model.seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, b)
            xy = gaussian(words[0], words[1])
            z = gaussian(words[2], words[3])
            move += bead.spread * wp.vec3(xy[0], xy[1], z[0])
        if wp.static(f.flow is not None):
            move += wp.float32(model.time_step) * flow_at(model.flow, world, position).linear
        return move

    return bead_move


def rigid_move_term(f: Features) -> wp.Function:
    """`(model, world, b, pose, wrench, step) -> Move` of a rigid body, mobility M = L Lᵀ in the body frame.

    (Δx, Δθ) = M (F, T) dt/η + √(2 k_B T dt/η) L ξ + flow. About the centre of diffusion this Euler–Maruyama step
    needs no drift correction (Brenner 1967, J. Colloid Interface Sci. 23, 407).
    """
    flow_at = FLOW_TERMS[f.flow] if f.flow else None
    gaussian = GAUSSIAN_TERMS[f.fast_math]

    @wp.func
    def flow_velocity(model: ModelData, world: int, b: int, pose: Pose) -> vec6:
        """Velocity of a force-free body in the flow: its spheres' shares of the mobility-weighted mean, body frame."""
        velocity = vec6()
        for i in range(model.body.drag_start[b], model.body.drag_start[b + 1]):
            point = pose.position + wp.quat_rotate(pose.rotation, model.body.drag_offset[i])
            u = flow_at(model.flow, world, point)
            v = wp.quat_rotate_inv(pose.rotation, u.linear)
            w = wp.quat_rotate_inv(pose.rotation, u.angular)
            velocity += model.body.flow_coupling[i] * vec6(v[0], v[1], v[2], w[0], w[1], w[2])
        return velocity

    @wp.func
    def rigid_move(model: ModelData, world: int, b: int, pose: Pose, load: Wrench, step: wp.int64) -> Move:
        """Drift, noise and advection of a rigid body, evaluated in its own frame."""
        dt = wp.float32(model.time_step)
        viscosity = model.medium.viscosity[world_row(model.medium.viscosity.shape[0], world)]
        shape = model.body.shape[b]
        f_body = wp.quat_rotate_inv(pose.rotation, load.force)
        t_body = wp.quat_rotate_inv(pose.rotation, load.torque)
        scale = dt / viscosity
        wrench = vec6(f_body[0], f_body[1], f_body[2], t_body[0], t_body[1], t_body[2])
        move = scale * (model.body.mobility[shape] * wrench)
        if wp.static(f.brownian):
            energy = model.medium.thermal_energy[world_row(model.medium.thermal_energy.shape[0], world)]
            a = noise_words(model.seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, b)
            c = noise_words(model.seed, wp.static(wp.uint32(Stream.BROWNIAN_B)), step, world, b)
            g0 = gaussian(a[0], a[1])
            g1 = gaussian(a[2], a[3])
            g2 = gaussian(c[0], c[1])
            noise = vec6(g0[0], g0[1], g1[0], g1[1], g2[0], g2[1])
            move += wp.sqrt(2.0 * energy * scale) * (model.body.cholesky[shape] * noise)
        if wp.static(f.flow is not None):
            move += dt * flow_velocity(model, world, b, pose)
        return Move(
            wp.quat_rotate(pose.rotation, wp.vec3(move[0], move[1], move[2])),
            wp.quat_rotate(pose.rotation, wp.vec3(move[3], move[4], move[5])),
        )

    return rigid_move


@wp.func
def is_rigid(body: BodyData, b: int) -> bool:
    """Whether body b has rotation."""
    return body.rigid[b] != 0


def free_move_term(f: Features) -> wp.Function:
    """`(model, control, state, world, b, pose, step, time) -> Move`: everything but contact."""
    wrench = wrench_term(f) if f.rigid else None
    rigid_move = rigid_move_term(f) if f.rigid else None
    bead_constants = bead_constants_term(f) if f.spheres else None
    bead_move = bead_move_term(f) if f.spheres else None

    @wp.func
    def free_rigid(
        model: ModelData,
        control: ControlData,
        state: StateData,
        world: int,
        b: int,
        pose: Pose,
        step: wp.int64,
        time: wp.float64,
    ) -> Move:
        """Move of a body with rotation."""
        return rigid_move(model, world, b, pose, wrench(model, control, state, world, b, pose, time), step)

    @wp.func
    def free_sphere(
        model: ModelData,
        control: ControlData,
        state: StateData,
        world: int,
        b: int,
        pose: Pose,
        step: wp.int64,
        time: wp.float64,
    ) -> Move:
        """Move of a lone sphere."""
        bead = bead_constants(model, control, world, b)
        linear = bead_move(model, control, state, bead, world, b, pose.position, step, time)
        return Move(linear, wp.vec3(0.0))

    @wp.func
    def free_move(
        model: ModelData,
        control: ControlData,
        state: StateData,
        world: int,
        b: int,
        pose: Pose,
        step: wp.int64,
        time: wp.float64,
    ) -> Move:
        """The sphere's or the rigid body's move, whichever `b` is."""
        move = Move(wp.vec3(0.0), wp.vec3(0.0))
        if is_rigid(model.body, b):
            move = free_rigid(model, control, state, world, b, pose, step, time)
        else:
            move = free_sphere(model, control, state, world, b, pose, step, time)
        return move

    if f.rigid and f.spheres:
        return free_move
    return free_rigid if f.rigid else free_sphere
