"""Symmetry groups of known order, and frames that turn with the body."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.hydrodynamics.covering import Elements
from otwarp.hydrodynamics.symmetry import body_frame, symmetries

TRIANGLE = np.array([[np.cos(a), np.sin(a), 0] for a in 2 * np.pi * np.arange(3) / 3])
TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CORNER = np.array([[0.0, 0, 0], [2, 0, 0], [4, 0, 0], [0, 3, 0], [0, 0, 1.5]])
CORNER = CORNER - CORNER.mean(axis=0)
TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def spheres(centres, radii=1.0) -> Elements:
    return Elements(centres, centres, np.broadcast_to(np.asarray(radii, float), (len(centres),)))


@pytest.mark.parametrize(
    ("elements", "order"),
    [
        (spheres(np.array([[0.0, 0, -1], [0, 0, 1]])), 12),  # three turns × mirror × exchange of the ends
        (spheres(np.array([[0.0, 0, -1], [0, 0, 1]]), [1, 0.5]), 6),
        (spheres(TRIANGLE), 12),
        (spheres(TRIANGLE, [1, 1, 0.5]), 4),
        (spheres(TETRAHEDRON), 24),
        (spheres(CUBE), 48),
        (spheres(CORNER), 1),
        (Elements(np.array([[0.0, 0, -2]]), np.array([[0.0, 0, 2]]), np.array([0.5])), 12),
        (Elements(-np.eye(3)[:2], np.eye(3)[:2], np.array([0.3, 0.3])), 16),  # a plus sign
    ],
    ids=["dimer", "unequal dimer", "triangle", "isosceles", "tetrahedron", "cube", "corner", "rod", "plus"],
)
def test_order_of_the_group(elements, order):
    turned = Elements(elements.start @ TURN.T, elements.end @ TURN.T, elements.radius)
    for e in (elements, turned):
        group = symmetries(e)
        assert len(group) == order
        np.testing.assert_array_equal(group[0].turn, np.eye(3))
        for s in group:
            np.testing.assert_allclose(s.turn @ s.turn.T, np.eye(3), atol=1e-9)
            middle = 0.5 * (e.start + e.end)
            np.testing.assert_allclose(middle[s.image], middle @ s.turn.T, atol=1e-9)


def test_slight_differences_count():
    bent = TRIANGLE + np.array([[0, 0, 0], [0, 0, 0], [0, 0.001, 0]])
    assert len(symmetries(spheres(bent - bent.mean(axis=0)))) == 2  # the plane of the three


@pytest.mark.parametrize("centres", [CORNER, TRIANGLE, TETRAHEDRON])
def test_frame_turns_with_the_body(centres):
    turn = TURN * np.sign(np.linalg.det(TURN))
    frame = body_frame(spheres(centres))
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(body_frame(spheres(centres @ turn.T)), frame @ turn.T, atol=1e-9)
