"""One body, one step, before contact: the wrench that acts on it and how far it moves freely."""

import warp as wp

from otwarp.kernels.features import Features
from otwarp.kernels.flow import FLOW_TERMS
from otwarp.kernels.random import Stream, gaussian_pair, noise_words
from otwarp.kernels.traps import commanded_animated, commanded_still, limited_focus, trap_force_term
from otwarp.kernels.types import BodyData, ControlData, ModelData, Move, Pose, StateData, Wrench, vec6, world_row

FEW_TRAPS = 2
"""Up to this many traps the loop over traps is unrolled; beyond, the code would only grow."""


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
    """`(model, world, b, pose, trap, command) -> Wrench`: what one trap does to one body (the sum of MSDM, eq. 2)."""
    trap_force = trap_force_term(f.trap_models)
    split = any(m.endswith("split") for m in f.trap_models)

    @wp.func
    def on_sphere(model: ModelData, world: int, b: int, pose: Pose, trap: int, command: wp.vec4) -> Wrench:
        """Lone sphere: a force, and no torque."""
        force = wp.vec3(0.0)
        element = model.body.trapped_start[b]
        if element < model.body.trapped_start[b + 1]:
            anchor = wp.vec3(command[0], command[1], command[2])
            anchor += model.traps.equilibrium[trap] * model.traps.axis[trap]
            radius = model.body.trapped[element][3]
            kind = model.body.trapped_kind[element]
            force = command[3] * trap_force(model.traps, world, trap, pose.position - anchor, radius, kind)
        return Wrench(force, wp.vec3(0.0))

    @wp.func
    def on_body(model: ModelData, world: int, b: int, pose: Pose, trap: int, command: wp.vec4) -> Wrench:
        """Rigid body: force and torque summed over its trapped spheres."""
        total = Wrench(wp.vec3(0.0), wp.vec3(0.0))
        anchor = wp.vec3(command[0], command[1], command[2])
        anchor += model.traps.equilibrium[trap] * model.traps.axis[trap]
        reach = model.traps.cutoff[world_row(model.traps.cutoff.shape[0], world), trap]
        if wp.static(split):
            axial = model.traps.axial_cutoff[world_row(model.traps.axial_cutoff.shape[0], world), trap]
            reach = wp.max(reach, axial)
        if model.traps.law_radius[trap] > 0.0:
            reach *= model.body.largest[b] / model.traps.law_radius[trap]
        # a trap that cannot reach the body costs one distance
        if wp.length(pose.position - anchor) < reach + model.body.bound[b]:
            for element in range(model.body.trapped_start[b], model.body.trapped_start[b + 1]):
                sphere = model.body.trapped[element]
                arm = wp.quat_rotate(pose.rotation, wp.vec3(sphere[0], sphere[1], sphere[2]))
                displacement = pose.position + arm - anchor
                kind = model.body.trapped_kind[element]
                force = command[3] * trap_force(model.traps, world, trap, displacement, sphere[3], kind)
                total.force += force
                total.torque += wp.cross(arm, force)
        return total

    return on_body if f.rigid else on_sphere


def wrench_term(f: Features) -> wp.Function:
    """`(model, control, state, world, b, pose, time) -> Wrench`: sum of all forces that are not contact."""
    trap_command = trap_command_term(f)
    trap_wrench = trap_wrench_term(f) if f.trap_models else None

    @wp.func
    def wrench(
        model: ModelData, control: ControlData, state: StateData, world: int, b: int, pose: Pose, time: wp.float64
    ) -> Wrench:
        """Traps one by one, then weight, which acts at the centroid."""
        total = Wrench(wp.vec3(0.0), wp.vec3(0.0))
        if wp.static(bool(f.trap_models) and f.traps <= FEW_TRAPS):
            for trap in range(wp.static(f.traps)):
                one = trap_wrench(model, world, b, pose, trap, trap_command(model, control, state, world, trap, time))
                total.force += one.force
                total.torque += one.torque
        if wp.static(bool(f.trap_models) and f.traps > FEW_TRAPS):
            traps = int(wp.static(f.traps))
            for trap in range(traps):
                one = trap_wrench(model, world, b, pose, trap, trap_command(model, control, state, world, trap, time))
                total.force += one.force
                total.torque += one.torque
        if wp.static(f.gravity):
            load = wp.vec3(0.0, 0.0, -model.body.weight[b])
            total.force += load
            if wp.static(f.rigid):
                total.torque += wp.cross(wp.quat_rotate(pose.rotation, model.body.weight_arm[b]), load)
        return total

    return wrench


def sphere_move_term(f: Features) -> wp.Function:
    """`(model, world, b, pose, wrench, step) -> Move` of a lone sphere: Δx = μ F dt + √(2 k_B T μ dt) ξ + u dt."""
    flow_at = FLOW_TERMS[f.flow] if f.flow else None

    @wp.func
    def sphere_move(model: ModelData, world: int, b: int, pose: Pose, load: Wrench, step: wp.int64) -> Move:
        """Drift, noise and advection of a sphere."""
        dt = wp.float32(model.time_step)
        viscosity = model.medium.viscosity[world_row(model.medium.viscosity.shape[0], world)]
        mobility_dt = model.body.translation[model.body.shape[b]] / viscosity * dt
        linear = mobility_dt * load.force
        if wp.static(f.brownian):
            energy = model.medium.thermal_energy[world_row(model.medium.thermal_energy.shape[0], world)]
            words = noise_words(model.seed, wp.static(wp.uint32(Stream.BROWNIAN_A)), step, world, b)
            xy = gaussian_pair(words[0], words[1])
            z = gaussian_pair(words[2], words[3])
            linear += wp.sqrt(2.0 * energy * mobility_dt) * wp.vec3(xy[0], xy[1], z[0])
        if wp.static(f.flow is not None):
            linear += dt * flow_at(model.flow, world, pose.position).linear
        return Move(linear, wp.vec3(0.0))

    return sphere_move


def rigid_move_term(f: Features) -> wp.Function:
    """`(model, world, b, pose, wrench, step) -> Move` of a rigid body, mobility M = L Lᵀ in the body frame.

    (Δx, Δθ) = M (F, T) dt/η + √(2 k_B T dt/η) L ξ + flow. About the centre of diffusion this Euler–Maruyama step
    needs no drift correction (Brenner 1967, J. Colloid Interface Sci. 23, 407).
    """
    flow_at = FLOW_TERMS[f.flow] if f.flow else None

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
            g0 = gaussian_pair(a[0], a[1])
            g1 = gaussian_pair(a[2], a[3])
            g2 = gaussian_pair(c[0], c[1])
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
    wrench = wrench_term(f)
    sphere_move = sphere_move_term(f) if f.spheres else None
    rigid_move = rigid_move_term(f) if f.rigid else None

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
        load = wrench(model, control, state, world, b, pose, time)
        move = Move(wp.vec3(0.0), wp.vec3(0.0))
        if wp.static(f.rigid and f.spheres):
            if is_rigid(model.body, b):
                move = rigid_move(model, world, b, pose, load, step)
            else:
                move = sphere_move(model, world, b, pose, load, step)
        elif wp.static(f.rigid):
            move = rigid_move(model, world, b, pose, load, step)
        else:
            move = sphere_move(model, world, b, pose, load, step)
        return move

    return free_move
