"""A constant force on a body, such as a field gradient exerts: magnetic, dielectrophoretic, or of a stirred liquid."""

import numpy as np
import warp as wp

from otwarp.kernels.body_forces.body_force import BodyForce
from otwarp.kernels.core.types import ForceInput


def external(body: ForceInput, force: wp.vec3) -> wp.vec3:
    """F = F₀ at the centre of diffusion, world axes [pN]."""
    return force


EXTERNAL = BodyForce.of(
    external, {"force": "pN"}, slope=0.0, load=lambda force: np.linalg.norm(force, axis=-1)
)  # fmt: skip
"""The force of `ot:body:externalForce`."""
