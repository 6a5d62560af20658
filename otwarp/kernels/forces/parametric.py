"""A force with parameters per body (`BodyForce`), from its place in `Features.forces` to the step."""

from typing import Any

import warp as wp

from otwarp.kernels.body_forces.body_force import BodyForce
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.functions import function_from_text
from otwarp.kernels.core.medium import thermal_energy_of, viscosity_of
from otwarp.kernels.core.packed import point_of, radius_of
from otwarp.kernels.core.rounding import PRECISION
from otwarp.kernels.core.step_constants import BeadConstants, RigidConstants
from otwarp.kernels.core.types import ControlData, ForceData, ForceInput, ModelData, Pose, StateData, Wrench, world_row
from otwarp.kernels.forces.zeros import no_wrench


@wp.func
def first_value(forces: ForceData, parameter: int, width: int, world: int, bodies: int, b: int) -> int:
    """Index in `forces.value` of a parameter of body b, `width` numbers of which belong together."""
    row = world_row(forces.layout[2 * parameter + 1], world)
    return forces.layout[2 * parameter] + width * (row * bodies + b)


@wp.func
def number_at(model: ModelData, parameter: int, world: int, b: int) -> float:
    """A parameter that is one number, in the unit it was declared with."""
    return model.forces[0].value[first_value(model.forces[0], parameter, 1, world, model.bodies, b)]


@wp.func
def vector_at(model: ModelData, parameter: int, world: int, b: int) -> wp.vec3:
    """A parameter that is a vector, in the unit it was declared with."""
    i = first_value(model.forces[0], parameter, 3, world, model.bodies, b)
    values = model.forces[0].value
    return wp.vec3(values[i], values[i + 1], values[i + 2])


@wp.func
def only_force(force: wp.vec3) -> Wrench:
    """A force [pN] at the centre of diffusion, with no torque."""
    return Wrench(force, wp.vec3(0.0))


@wp.func
def as_it_is(wrench: Wrench) -> Wrench:
    """A force [pN] and a torque about the centre of diffusion [pN·µm] as the user's function gave them."""
    return wrench


def first_parameter(forces: tuple[BodyForce, ...], index: int) -> int:
    """Parameters of all forces before the one at `index`."""
    return sum(len(force.parameters) for force in forces[:index])


def valued_term(forces: tuple[BodyForce, ...], index: int) -> wp.Function:
    """`(model, world, b, input) -> Wrench` of one force, with its parameters filled in."""
    force, first = forces[index], first_parameter(forces, index)
    values = [
        f", {'number_at' if p.width == 1 else 'vector_at'}(model, {first + n}, world, b)"
        for n, p in enumerate(force.parameters)
    ]
    text = (
        "def valued(model: ModelData, world: int, b: int, input: ForceInput) -> Wrench:\n"
        f'    """{force.name} with the parameters of the body."""\n'
        f"    return wrench_of(force(input{''.join(values)}))\n"
    )
    names: dict[str, Any] = {
        "ModelData": ModelData,
        "ForceInput": ForceInput,
        "Wrench": Wrench,
        "number_at": number_at,
        "vector_at": vector_at,
        "wrench_of": as_it_is if force.turns else only_force,
        "force": force.compiled(PRECISION),
    }
    return wp.func(function_from_text("valued", text, names))


@wp.func
def force_input(model: ModelData, world: int, b: int, pose: Pose, radius: float, time: wp.float64) -> ForceInput:
    """What a force may depend on: pose [µm], radius [µm], time [s], k_B T [pN·µm], viscosity [pN·s/µm²], indices."""
    known = ForceInput()
    known.position = pose.position
    known.rotation = pose.rotation
    known.radius = radius
    known.time = wp.float32(time)
    known.exact_time = time
    known.thermal_energy = thermal_energy_of(model, world)
    known.viscosity = viscosity_of(model, world)
    known.world = model.first_world + world
    known.body = b
    return known


def parametric_wrench_term(f: Features, index: int) -> wp.Function:
    """`(model, world, b, pose, time) -> Wrench` of force `index` on a body, about its centre of diffusion."""
    force = f.forces[index]
    valued = valued_term(f.forces, index)
    acting = 2 * first_parameter(f.forces, len(f.forces))
    by_sphere = force.acts_on == "spheres" and f.rigid

    @wp.func
    def on_spheres(model: ModelData, world: int, b: int, pose: Pose, time: wp.float64) -> Wrench:
        """Sum over the spheres: force [pN], and torque with its arm about the centre of diffusion [pN·µm]."""
        total = no_wrench()
        for i in range(model.forces[0].sphere_start[b], model.forces[0].sphere_start[b + 1]):
            sphere = model.forces[0].sphere[i]
            arm = wp.quat_rotate(pose.rotation, point_of(sphere))
            there = Pose(pose.position + arm, pose.rotation)
            one = valued(model, world, b, force_input(model, world, b, there, radius_of(sphere), time))
            total.force += one.force
            total.torque += wp.cross(arm, one.force) + one.torque
        return total

    @wp.func
    def wrench(model: ModelData, world: int, b: int, pose: Pose, time: wp.float64) -> Wrench:
        """Force [pN] and torque [pN·µm]; 0 on a body that the force does not act on."""
        total = no_wrench()
        if model.forces[0].layout[wp.static(acting) + wp.static(index) * model.bodies + b] != 0:
            if wp.static(by_sphere):
                total = on_spheres(model, world, b, pose, time)
            else:
                total = valued(model, world, b, force_input(model, world, b, pose, model.body.bound[b], time))
        return total

    return wrench


def parametric_on_sphere(f: Features, index: int) -> wp.Function:
    """Force `index` on a lone sphere, as `ForceRow.on_sphere`."""
    wrench = parametric_wrench_term(f, index)

    @wp.func
    def on_sphere(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> wp.vec3:  # fmt: skip
        """Its force [pN]; a lone sphere has no orientation that a torque could change."""
        return wrench(model, world, b, Pose(position, wp.quat_identity()), time).force

    return on_sphere


def parametric_on_body(f: Features, index: int) -> wp.Function:
    """Force `index` on a rigid body, as `ForceRow.on_body`."""
    wrench = parametric_wrench_term(f, index)

    @wp.func
    def on_body(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> Wrench:  # fmt: skip
        """Force [pN] and torque about the centre of diffusion [pN·µm]."""
        return wrench(model, world, b, pose, time)

    return on_body
