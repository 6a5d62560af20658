"""Weight minus buoyancy, along −z; both act at the centroid, for the density of a body is uniform."""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BeadConstants, RigidConstants
from otwarp.kernels.core.types import ControlData, ModelData, Pose, StateData, Wrench
from otwarp.kernels.forces.force import BodyFacts, Load


def weight_of_sphere(f: Features) -> wp.Function:
    """`(model, control, state, bead, world, b, position, time) -> vec3` [pN]."""

    @wp.func
    def weight(
        model: ModelData, control: ControlData, state: StateData, bead: BeadConstants, world: int, b: int,
        position: wp.vec3, time: wp.float64,
    ) -> wp.vec3:  # fmt: skip
        """F = −(ρ − ρ_medium) V g ẑ [pN], prepared in `BeadConstants`."""
        return wp.vec3(0.0, 0.0, -bead.weight)

    return weight


def weight_of_body(f: Features) -> wp.Function:
    """`(model, control, state, body, world, b, pose, time) -> Wrench` about the centre of diffusion."""

    @wp.func
    def weight(
        model: ModelData, control: ControlData, state: StateData, body: RigidConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> Wrench:  # fmt: skip
        """F = −(ρ − ρ_medium) V g ẑ [pN] at the centroid, with its torque about the centre of diffusion [pN·µm]."""
        load = wp.vec3(0.0, 0.0, -model.body.weight[b])
        return Wrench(load, wp.cross(wp.quat_rotate(pose.rotation, model.body.weight_arm[b]), load))

    return weight


def weight_load(facts: BodyFacts) -> Load:
    """|W|, and the torque when it hangs level."""
    return Load(force=abs(facts.weight), torque=abs(facts.weight) * facts.weight_arm)
