"""Contacts solved for one point of each body: laws and equation of motion in float64."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.contact import Contact
from otwarp.kernels.contact.contact_list import ContactList, solved_term
from otwarp.kernels.contact.point_solve import MANY, partners_term, solve_points_term
from otwarp.kernels.core.types import ModelData
from tests.kernels.contact.test_body_solve import BODIES, COUNT, FEATURES, NODES, listed_of, pressed_contacts

_partners, _solve, _solved = (term(FEATURES) for term in (partners_term, solve_points_term, solved_term))

THROUGH = np.array([[2, -1], [2, 0], [2, 0], [2, 0], [2, 1], [2, 1], [2, 1]])
"""A lone sphere between two rigid bodies, and before an obstacle."""


@wp.kernel(enable_backward=False)
def probe_points(
    model: ModelData,
    position: wp.array(dtype=wp.vec3),
    rotation: wp.array(dtype=wp.quat),
    given: wp.array(dtype=Contact),
    linear: wp.array(dtype=wp.vec3),
    angular: wp.array(dtype=wp.vec3),
    again: bool,
    listed: ContactList,
    load: wp.array(dtype=float),
    error: wp.array(dtype=float),
):
    moved = wp.zeros(shape=(NODES,), dtype=wp.vec3)
    start = wp.zeros(shape=(wp.static(2 * BODIES),), dtype=wp.vec3)
    for b in range(BODIES):
        start[b] = linear[b]
        start[BODIES + b] = angular[b]
    listed_of(given, linear, angular, listed)
    partners = _partners(model, listed, COUNT)
    error[0] = float(partners)
    if partners != MANY:
        error[0] = _solve(model, 0, listed, COUNT, partners, position, rotation, False, linear, angular, moved)
        if again:
            # the same step once more, from the solution of the first
            for b in range(BODIES):
                linear[b] = start[b]
                angular[b] = start[BODIES + b]
            error[0] = _solve(model, 0, listed, COUNT, partners, position, rotation, True, linear, angular, moved)
    for i in range(COUNT):
        load[i] = _solved(listed, i).load


@pytest.mark.parametrize("hardness", [2e2, 2e3, 2e5, 2e6], ids=["soft", "stiffer", "stiff", "hard"])
@pytest.mark.parametrize("again", [False, True], ids=["first stage", "second stage"])
def test_loads_obey_law_and_motion(hardness, again, device):
    """As `test_body_solve`, with turning bodies that forces reach through the centre of the sphere alone."""
    assert pressed_contacts(THROUGH, probe_points, hardness, again, device) > 40
