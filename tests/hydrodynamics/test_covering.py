"""Coverings against areas known in closed form, and what makes them even."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from otwarp.hydrodynamics.covering import Covering, Elements, cover

FRAME = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]

SEAM = 0.01
"""Relative error of an exposed area: one sample in a hundred on the wrong side of a seam."""


def elements(*rows: tuple[list[float], list[float], float]) -> Elements:
    start, end, radius = zip(*rows, strict=True)
    return Elements(np.array(start, float), np.array(end, float), np.array(radius, float))


def ball(x: float, y: float, z: float, radius: float) -> tuple[list[float], list[float], float]:
    return ([x, y, z], [x, y, z], radius)


def spacing(covering: Covering) -> np.ndarray:
    return cKDTree(covering.position).query(covering.position, 2)[0][:, 1] / np.sqrt(covering.area)


@pytest.mark.parametrize("count", [12, 48, 200])
def test_lone_sphere(count):
    c = cover(elements(ball(1, 2, 3, 1.5)), count, FRAME)
    assert len(c.area) == count
    assert c.area.sum() == pytest.approx(4 * np.pi * 1.5**2, rel=1e-12)
    np.testing.assert_allclose(c.position, np.array([1, 2, 3]) + 1.5 * c.normal, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(c.normal, axis=1), 1)
    np.testing.assert_allclose(c.curvature, 1 / 1.5)
    assert spacing(c).min() > 0.7  # 1.07 on a triangular lattice, 1 on a square one
    assert c.area.std() < 0.15 * c.area.mean()


def test_overlapping_spheres_show_their_caps():
    """A sphere whose neighbour's seam is at x = h from its centre shows the zone of height a + h."""
    h = 0.6
    c = cover(elements(ball(0, 0, 0, 1), ball(2 * h, 0, 0, 1)), 100, FRAME)
    assert c.area.sum() == pytest.approx(2 * 2 * np.pi * (1 + h), rel=SEAM)
    np.testing.assert_array_less(c.position[c.owner == 0, 0], h)
    np.testing.assert_array_less(h, c.position[c.owner == 1, 0])
    # nodes of the two spheres may come close at the seam, not nodes of one
    for k in (0, 1):
        one = c.position[c.owner == k]
        assert cKDTree(one).query(one, 2)[0][:, 1].min() > 0.6 * np.sqrt(c.area.mean())


def test_rod_is_a_capsule():
    c = cover(elements(([0, 0, -2], [0, 0, 2], 0.5)), 40, FRAME)
    assert c.area.sum() == pytest.approx(2 * np.pi * 0.5 * (4 + 1), rel=1e-12)
    straight = np.abs(c.position[:, 2]) < 2
    np.testing.assert_allclose(np.linalg.norm(c.position[straight, :2], axis=1), 0.5)
    np.testing.assert_allclose(c.curvature, np.where(straight, 1.0, 2.0))
    assert spacing(c).min() > 0.7


def test_rod_that_ends_in_spheres():
    """Of the rod, what sticks out of the spheres: their distance less twice √(a² − b²)."""
    a, b, half = 1.0, 0.4, 3.0
    e = elements(ball(0, 0, -half, a), ball(0, 0, half, a), ([0, 0, -half], [0, 0, half], b))
    c = cover(e, 60, FRAME)
    seam = np.sqrt(a**2 - b**2)
    assert c.area[c.owner == 2].sum() == pytest.approx(2 * np.pi * b * 2 * (half - seam), rel=SEAM)
    assert c.area[c.owner < 2].sum() == pytest.approx(2 * 2 * np.pi * a * (a + seam), rel=SEAM)


def test_coinciding_surfaces_are_covered_once():
    """A sphere of the rod's radius at its end has the rod's surface there: the earlier element keeps it."""
    rod = ([0.0, 0, 0], [4.0, 0, 0], 1.0)
    alone, both = cover(elements(rod), 50, FRAME), cover(elements(ball(0, 0, 0, 1), rod), 50, FRAME)
    assert both.area.sum() == pytest.approx(alone.area.sum(), rel=SEAM)
    assert both.area[both.owner == 0].sum() == pytest.approx(2 * np.pi, rel=SEAM)


def test_a_belt_is_covered_all_around():
    """A sphere that a slightly thinner rod runs through shows a narrow belt; no node may fall onto the axis."""
    c = cover(elements(ball(0, 0, 0, 1.05), ([0, 0, -3], [0, 0, 3], 1.0)), 12, FRAME)
    belt = c.owner == 0
    assert belt.sum() >= 2
    np.testing.assert_allclose(np.linalg.norm(c.position[belt], axis=1), 1.05)
    assert np.isfinite(c.normal).all()
    assert c.area[belt].sum() == pytest.approx(4 * np.pi * 1.05 * np.sqrt(1.05**2 - 1), rel=0.1)  # 288 samples in all


def test_buried_element_gets_no_nodes():
    c = cover(elements(ball(0, 0, 0, 2), ball(0.5, 0, 0, 1)), 30, FRAME)
    assert (c.owner == 0).all()
    assert c.area.sum() == pytest.approx(16 * np.pi)


def test_turns_with_its_frame():
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    e = elements(ball(0, 0, 0, 1), ball(1.2, 0, 0, 0.7), ([0, 0, 0], [0, 2, 0], 0.4))
    turned = Elements(e.start @ turn.T, e.end @ turn.T, e.radius)
    a, b = cover(e, 40, FRAME), cover(turned, 40, FRAME @ turn.T)
    np.testing.assert_allclose(b.position, a.position @ turn.T, atol=1e-9)
    np.testing.assert_allclose(b.area, a.area)
