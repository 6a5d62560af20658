"""Contacts solved for one point of each body: laws and equation of motion in float64."""

import numpy as np
import pytest
import warp as wp

from otwarp.kernels.contact.body_solve import BALANCED
from otwarp.kernels.contact.point_solve import FIRST_SLACK, MANY, balanced_next, joined_term, solve_points_term
from otwarp.kernels.core.types import ModelData
from tests.kernels.contact.test_body_solve import (
    AGAIN,
    COUNT,
    FEATURES,
    HARDNESS,
    NODES,
    Pressed,
    Problem,
    freed,
    listed_of,
    loads_of,
    pressed_contacts,
)

_joined, _solve = (term(FEATURES) for term in (joined_term, solve_points_term))

THROUGH = np.array([[2, -1], [2, 0], [2, 0], [2, 0], [2, 1], [2, 1], [2, 1]])
"""A lone sphere between two rigid bodies, and before an obstacle."""


@wp.kernel(enable_backward=False)
def probe_points(model: ModelData, p: Pressed, rough: bool):
    moved = wp.zeros(shape=(NODES,), dtype=wp.vec3)
    listed_of(p)
    partners = wp.int32(0)
    for i in range(COUNT):
        partners = _joined(model, partners, p.given[i].a, p.given[i].b)
    p.error[0] = float(partners)
    if partners != MANY:
        stages = wp.where(p.again, 2, 1)
        for stage in range(stages):
            freed(p)
            p.error[0] = _solve(
                model, 0, p.listed, COUNT, partners, p.position, p.rotation, stage > 0, p.linear, p.angular, moved,
                rough,
            )  # fmt: skip
    loads_of(p)


@HARDNESS
@AGAIN
def test_loads_obey_law_and_motion(hardness, again, device):
    """As `test_body_solve`, with turning bodies that forces reach through the centre of the sphere alone."""
    assert pressed_contacts(THROUGH, probe_points, hardness, again, device, more=(False,)) > 40


@HARDNESS
def test_rough_solutions_are_within_the_slack_of_a_first_stage(hardness, device):
    """Moves [µm, rad] of 12 random steps whose last step is not looked at, beside those that are balanced."""
    apart = []
    for seed in range(12):
        problem = Problem(seed, hardness, THROUGH)
        (_, moved, _), (_, rough, error) = (
            problem.solve(device, kernel=probe_points, more=(ends,)) for ends in (False, True)
        )
        assert error == 0.0
        apart.append(np.abs(rough - moved).max())
    assert max(apart) <= float(FIRST_SLACK * BALANCED)
    # soft contacts are balanced before that
    assert hardness == 2e2 or max(apart) > 0.0


@wp.kernel(enable_backward=False)
def probe_joined(model: ModelData, pairs: wp.array(dtype=wp.vec2i), found: wp.array(dtype=int)):
    partners = wp.int32(0)
    for i in range(pairs.shape[0]):
        partners = _joined(model, partners, pairs[i][0], pairs[i][1])
    found[0] = partners


@pytest.mark.parametrize(
    ("pairs", "partners"),
    [
        ([(2, 0), (2, 1), (2, -1)], (3, 3, 0)),
        ([(2, 1), (2, 1)], (0, 3, 0)),
        ([(2, -1)], (0, 0, 0)),
        ([(1, 0), (2, 0)], None),
        ([(2, 0), (0, -1)], None),
        ([(1, -1), (2, 1)], None),
    ],
)
def test_rigid_bodies_have_one_partner_or_are_not_moved_by_points(pairs, partners, device):
    """Bodies 0 and 1 are rigid, body 2 is a lone sphere."""
    model = ModelData()
    model.body.rigid = wp.array([1, 1, 0], dtype=wp.int32, device=device)
    found = wp.zeros(1, dtype=int, device=device)
    wp.launch(probe_joined, dim=1, inputs=[model, wp.array(pairs, dtype=wp.vec2i, device=device), found], device=device)
    expected = int(MANY) if partners is None else sum(p << 4 * b for b, p in enumerate(partners))
    assert found.numpy()[0] == expected


@pytest.mark.parametrize(
    ("before", "error", "ends"),
    [(1e-2, 1e-4, True), (1e-2, 5e-3, False), (0.0, 1e-4, False), (1e-3, 2e-4, True), (1e-3, 1e-3, False)],
)
def test_the_next_step_should_balance_where_errors_have_fallen_as_squares(before, error, ends):
    assert balanced_next(before, error) == ends
