"""One force with parameters, evaluated where the host asks: how strong it is, and how fast it changes with place."""

import functools

import warp as wp

from otwarp.kernels.core.features import Features
from otwarp.kernels.core.types import ModelData, Pose
from otwarp.kernels.forces.parametric import parametric_wrench_term


@functools.lru_cache(maxsize=64)
def make_force_probe(f: Features, index: int) -> wp.Kernel:
    """Kernel over n situations: force [pN] and torque about the centre of diffusion [pN·µm] of one force."""
    wrench = parametric_wrench_term(f, index)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        model: ModelData, body: wp.array(dtype=wp.int32), world: wp.array(dtype=wp.int32),
        position: wp.array(dtype=wp.vec3), rotation: wp.array(dtype=wp.quat), time: wp.array(dtype=wp.float64),
        force: wp.array(dtype=wp.vec3), torque: wp.array(dtype=wp.vec3),
    ):  # fmt: skip
        """Write force [pN] and torque [pN·µm] in situation n: world, position [µm], rotation and time [s]."""
        n = wp.tid()
        value = wrench(model, world[n], body[n], Pose(position[n], rotation[n]), time[n])
        force[n] = value.force
        torque[n] = value.torque

    return probe
