"""What forces with parameters do to the bodies at the present state, measured on demand."""

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, Pose, StateData, Wrench
from otwarp.kernels.core.worlds import time_term
from otwarp.kernels.forces.parametric import parametric_wrench_term


def make_force_readout(f: Features) -> wp.Kernel:
    """Kernel over (world, body): force [pN] and torque about the centre of diffusion [pN·µm] of each of `f.forces`."""
    first = parametric_wrench_term(f, 0)
    terms = [parametric_wrench_term(f, index) for index in range(1, len(f.forces))]

    def nth(index: int, before: wp.Function, term: wp.Function) -> wp.Function:
        """A branch on the index of a force: `term` for this one, `before` for lower ones."""

        @wp.func
        def chosen(model: ModelData, world: int, b: int, pose: Pose, time: wp.float64, force: int) -> Wrench:
            """Force [pN] and torque [pN·µm] of the force of this index, or of one before it in the table."""
            value = Wrench(wp.vec3(0.0), wp.vec3(0.0))
            if force == wp.static(index):
                value = term(model, world, b, pose, time)
            else:
                value = before(model, world, b, pose, time, force)
            return value

        return chosen

    @wp.func
    def only(model: ModelData, world: int, b: int, pose: Pose, time: wp.float64, force: int) -> Wrench:
        """Force [pN] and torque [pN·µm] of the first force."""
        return first(model, world, b, pose, time)

    wrench = only
    time_of = time_term(f)
    for index, term in enumerate(terms, start=1):
        wrench = nth(index, wrench, term)

    @wp.kernel(module="unique", enable_backward=False)
    def per_body(
        model: ModelData, state: StateData, time: wp.float64, force: wp.array3d(dtype=wp.vec3),
        torque: wp.array3d(dtype=wp.vec3),
    ):  # fmt: skip
        """Write (W, F, B) forces [pN] and torques about the centre of diffusion [pN·µm] in world axes."""
        world, b = wp.tid()
        pose = Pose(state.position[world, b], wp.quat_identity())
        if wp.static(f.rigid):
            pose.rotation = state.orientation[world, b]
        for index in range(wp.static(len(f.forces))):
            value = wrench(model, world, b, pose, time_of(model, world, time), index)
            force[world, index, b] = value.force
            torque[world, index, b] = value.torque

    return per_body
