"""How far bodies give way to a force at a point in one step."""

import warp as wp

from otwarp.kernels.contact.contact import rigid_response, sphere_response
from otwarp.kernels.core.features import Features
from otwarp.kernels.core.reads import mat66_at
from otwarp.kernels.core.types import ModelData, Move, Pose, vec6
from otwarp.kernels.hydrodynamics.walls import walled_sphere_response_term
from otwarp.kernels.hydrodynamics.walls_rigid import walled_rigid_response_term


def response_term(f: Features) -> wp.Function:
    """`(model, b, pose, scale, arm, force) -> Move`: what a force at a point moves in one step; `scale` = dt/η."""

    @wp.func
    def free_sphere(model: ModelData, b: int, pose: Pose, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
        """Displacement [µm] of a lone sphere away from hydrodynamic walls by `force` [pN] acting for one step."""
        return sphere_response(model.body, b, scale, arm, force)

    @wp.func
    def free_rigid(model: ModelData, b: int, pose: Pose, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
        """Move [µm, rad] of a rigid body away from hydrodynamic walls by `force` [pN] acting at `arm` for one step."""
        return rigid_response(model.body, b, pose.rotation, scale, arm, force)

    of_sphere = walled_sphere_response_term(f) if f.walls else free_sphere
    of_rigid = walled_rigid_response_term(f) if f.walls else free_rigid

    @wp.func
    def response(model: ModelData, b: int, pose: Pose, scale: float, arm: wp.vec3, force: wp.vec3) -> Move:
        """Move [µm, rad] of body b by `force` [pN] acting at `arm` [µm] for one step."""
        move = Move(wp.vec3(0.0), wp.vec3(0.0))
        if wp.static(f.rigid and f.spheres):
            if model.body.rigid[b] != 0:
                move = of_rigid(model, b, pose, scale, arm, force)
            else:
                move = of_sphere(model, b, pose, scale, arm, force)
        elif wp.static(f.rigid):
            move = of_rigid(model, b, pose, scale, arm, force)
        else:
            move = of_sphere(model, b, pose, scale, arm, force)
        return move

    return response


def give_term(f: Features) -> wp.Function:
    """`(model, b, pose, scale, arm, normal) -> give`: displacement of a point along a unit force there in one step.

    Away from hydrodynamic walls; `scale` = dt/η.
    """

    @wp.func
    def give(model: ModelData, b: int, pose: Pose, scale: float, arm: wp.vec3, normal: wp.vec3) -> float:
        """wᵀMw dt/η [µm/pN] of the wrench w = (n, arm × n), or μ dt/η of a lone sphere."""
        turns = bool(wp.static(f.rigid))
        if wp.static(f.rigid and f.spheres):
            turns = model.body.rigid[b] != 0
        shape = model.body.shape[b]
        mobility = float(0.0)
        if wp.static(f.rigid):
            if turns:
                n = wp.quat_rotate_inv(pose.rotation, normal)
                t = wp.quat_rotate_inv(pose.rotation, wp.cross(arm, normal))
                wrench = vec6(n[0], n[1], n[2], t[0], t[1], t[2])
                mobility = wp.dot(wrench, mat66_at(model.body.mobility, shape) * wrench)
        if not turns:
            mobility = model.body.translation[shape]
        return scale * mobility

    return give
