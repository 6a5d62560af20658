"""Contacts solved for one point of each body: laws and equation of motion in float64."""

import numpy as np
import warp as wp

from otwarp.kernels.contact.point_solve import MANY, partners_term, solve_points_term
from otwarp.kernels.core.types import ModelData
from tests.kernels.contact.test_body_solve import (
    AGAIN,
    COUNT,
    FEATURES,
    HARDNESS,
    NODES,
    Pressed,
    freed,
    listed_of,
    loads_of,
    pressed_contacts,
)

_partners, _solve = (term(FEATURES) for term in (partners_term, solve_points_term))

THROUGH = np.array([[2, -1], [2, 0], [2, 0], [2, 0], [2, 1], [2, 1], [2, 1]])
"""A lone sphere between two rigid bodies, and before an obstacle."""


@wp.kernel(enable_backward=False)
def probe_points(model: ModelData, p: Pressed):
    moved = wp.zeros(shape=(NODES,), dtype=wp.vec3)
    listed_of(p)
    partners = _partners(model, p.listed, COUNT)
    p.error[0] = float(partners)
    if partners != MANY:
        stages = wp.where(p.again, 2, 1)
        for stage in range(stages):
            freed(p)
            p.error[0] = _solve(
                model, 0, p.listed, COUNT, partners, p.position, p.rotation, stage > 0, p.linear, p.angular, moved
            )
    loads_of(p)


@HARDNESS
@AGAIN
def test_loads_obey_law_and_motion(hardness, again, device):
    """As `test_body_solve`, with turning bodies that forces reach through the centre of the sphere alone."""
    assert pressed_contacts(THROUGH, probe_points, hardness, again, device) > 40
