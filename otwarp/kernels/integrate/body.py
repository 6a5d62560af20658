"""Any body: lone spheres and rigid bodies as one kind, for drivers whose threads meet both.

A lone sphere is lifted to a pose whose orientation nobody looks at, and to twists without rotation.
"""

import warp as wp

from otwarp.kernels.bodies.bead import bead_constants_term
from otwarp.kernels.bodies.rigid import angular_part, linear_part, rigid_constants_term, twist
from otwarp.kernels.core.dynamics import Dynamics
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.step_constants import BodyConstants
from otwarp.kernels.core.types import ControlData, ModelData, Move, Pose, StateData, mat66, vec6
from otwarp.kernels.hydrodynamics.walls import sphere_dynamics
from otwarp.kernels.hydrodynamics.walls_rigid import turning_dynamics


def body_constants_term(f: Features) -> wp.Function:
    """`(model, control, world, b) -> BodyConstants` in a scene with lone spheres: those of the kind that b is."""
    of_bead = bead_constants_term(f)
    of_rigid = rigid_constants_term(f) if f.rigid else None

    @wp.func
    def body_constants(model: ModelData, control: ControlData, world: int, b: int) -> BodyConstants:
        """Constants of a sphere in `bead` or of a rigid body in `rigid`; the other half stays empty."""
        body = BodyConstants()
        if wp.static(f.rigid):
            body.turns = model.body.rigid[b]
        if body.turns != 0:
            if wp.static(f.rigid):
                body.rigid = of_rigid(model, control, world, b)
        else:
            body.bead = of_bead(model, control, world, b)
        return body

    return body_constants


def lifted(bead: Dynamics) -> Dynamics:
    """Dynamics of a lone sphere on poses and twists."""

    @wp.func
    def drift(
        model: ModelData, control: ControlData, state: StateData, body: BodyConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> vec6:  # fmt: skip
        """Drift of the sphere as a twist without rotation [µm, 0]."""
        return twist(bead_drift(model, control, state, body.bead, world, b, pose.position, time), wp.vec3(0.0))

    @wp.func
    def noise(model: ModelData, body: BodyConstants, world: int, b: int, pose: Pose, step: wp.int64) -> vec6:
        """Thermal displacement of the sphere as a twist without rotation [µm, 0]."""
        return twist(bead_noise(model, body.bead, world, b, pose.position, step), wp.vec3(0.0))

    @wp.func
    def shifted(pose: Pose, move: vec6) -> Pose:
        """Pose after a displacement [µm]; the orientation stays."""
        return Pose(pose.position + linear_part(move), pose.rotation)

    @wp.func
    def pulled_back(move: vec6, drift: vec6) -> vec6:
        """The drift itself [µm]: displacements of a sphere commute."""
        return drift

    @wp.func
    def stiffness(
        model: ModelData, control: ControlData, state: StateData, body: BodyConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> mat66:  # fmt: skip
        """Stiffness of the sphere [pN/µm] in the upper left 3×3 block; 0 against rotation."""
        k = bead_stiffness(model, control, state, body.bead, world, b, pose.position, time)
        total = mat66(0.0)
        for i in range(3):
            for j in range(3):
                total[i, j] = k[i, j]
        return total

    @wp.func
    def relax(body: BodyConstants, pose: Pose, k: mat66, move: vec6) -> vec6:
        """Z v = μ dt K v [µm]: what a stiffness K [pN/µm] pulls back of a displacement v in one step."""
        return body.bead.mobility_dt * (k * move)

    bead_drift, bead_noise, bead_stiffness = bead.drift, bead.noise, bead.stiffness
    return Dynamics(
        Pose, vec6, BodyConstants, mat66, drift, noise, shifted, pulled_back, stiffness, relax, bead.early
    )  # fmt: skip


def either(bead: Dynamics, rigid: Dynamics) -> Dynamics:
    """Lifted spheres and rigid bodies, told apart body by body."""

    @wp.func
    def drift(
        model: ModelData, control: ControlData, state: StateData, body: BodyConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> vec6:  # fmt: skip
        """Drift [µm, rad] of body b in one step: rigid if it turns, else that of a sphere."""
        move = vec6()
        if body.turns != 0:
            move = rigid_drift(model, control, state, body.rigid, world, b, pose, time)
        else:
            move = bead_drift(model, control, state, body, world, b, pose, time)
        return move

    @wp.func
    def noise(model: ModelData, body: BodyConstants, world: int, b: int, pose: Pose, step: wp.int64) -> vec6:
        """Thermal move [µm, rad] of body b in one step: rigid if it turns, else that of a sphere."""
        kick = vec6()
        if body.turns != 0:
            kick = rigid_noise(model, body.rigid, world, b, pose, step)
        else:
            kick = bead_noise(model, body, world, b, pose, step)
        return kick

    @wp.func
    def stiffness(
        model: ModelData, control: ControlData, state: StateData, body: BodyConstants, world: int, b: int, pose: Pose,
        time: wp.float64,
    ) -> mat66:  # fmt: skip
        """Stiffness (6, 6) [pN/µm, pN, pN·µm] of body b: rigid if it turns, else that of a sphere."""
        k = mat66(0.0)
        if body.turns != 0:
            k = rigid_stiffness(model, control, state, body.rigid, world, b, pose, time)
        else:
            k = bead_stiffness(model, control, state, body, world, b, pose, time)
        return k

    @wp.func
    def relax(body: BodyConstants, pose: Pose, k: mat66, move: vec6) -> vec6:
        """Z v [µm, rad] of the body: rigid if it turns, else that of a sphere."""
        result = bead_relax(body, pose, k, move)
        if body.turns != 0:
            result = rigid_relax(body.rigid, pose, k, move)
        return result

    bead_drift, bead_noise, bead_stiffness, bead_relax = bead.drift, bead.noise, bead.stiffness, bead.relax
    rigid_drift, rigid_noise, rigid_stiffness, rigid_relax = rigid.drift, rigid.noise, rigid.stiffness, rigid.relax
    # moving and turning a sphere with a twist that does not turn is the same for both
    return Dynamics(
        Pose, vec6, BodyConstants, mat66, drift, noise, rigid.shifted, rigid.pulled_back, stiffness, relax, bead.early
    )  # fmt: skip


def body_dynamics(f: Features) -> tuple[wp.Function, Dynamics]:
    """`(model, control, world, b) -> constants`, and the dynamics that takes them, of the bodies a scene has."""
    if not f.spheres:
        return rigid_constants_term(f), turning_dynamics(f)
    sphere = lifted(sphere_dynamics(f))
    return body_constants_term(f), either(sphere, turning_dynamics(f)) if f.rigid else sphere


@wp.func
def as_move(v: vec6) -> Move:
    """A twist as a `Move`: displacement [µm] and rotation vector [rad]."""
    return Move(linear_part(v), angular_part(v))
