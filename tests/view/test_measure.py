from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from otwarp.teleop.page.compose import ball, box, compose
from otwarp.view import RecordedRun
from otwarp.view.measure import hit, on_plane, ray_spheres, ray_triangles
from otwarp.view.sight import preset


def test_a_ray_meets_a_cube_where_it_should():
    points, faces = box()
    down = np.array([0.0, 0.0, -1.0])
    assert ray_triangles(points, faces, np.array([0.3, -0.2, 5.0]), down) == pytest.approx(4.0)
    assert ray_triangles(points, faces, np.array([0.3, -0.2, 0.0]), down) == pytest.approx(1.0)  # from within
    assert ray_triangles(points, faces, np.array([1.3, -0.2, 5.0]), down) == np.inf
    assert ray_triangles(points, faces, np.array([0.3, -0.2, -5.0]), down) == np.inf  # behind


def test_a_sphere_and_its_triangles_are_met_alike():
    points, faces = ball(3)
    rng = np.random.default_rng(3)
    for _ in range(50):
        origin = 4.0 * _unit(rng.normal(size=3))
        way = _unit(0.6 * rng.normal(size=3) / 3.0 - origin)
        exact = ray_spheres(np.zeros((1, 3)), np.ones(1), origin, way)
        flat = ray_triangles(points, faces, origin, way)
        if np.isfinite(exact) and np.isfinite(flat):
            edge = np.sqrt(1.0 - min(np.linalg.norm(np.cross(origin, way)), 1.0) ** 2)
            assert flat == pytest.approx(exact, abs=0.01 / max(edge, 0.05))  # the triangles lie 0.4 % inside


def test_a_click_on_the_cell_is_on_the_cell(run: Path):
    source = RecordedRun(run)
    drawing, frame = compose(source.scene), source.frame(30)
    eye = np.array(preset("close", drawing, frame).position)
    centre = frame.position[2].astype(float)
    place = hit(drawing, frame, eye, centre - eye)
    radius = source.scene.bodies[2].spheres[0].radius
    assert place is not None
    assert np.linalg.norm(place - centre) == pytest.approx(radius, rel=1e-5)
    assert hit(drawing, frame, eye, eye - centre) is None
    source.close()


def test_a_click_beside_everything_is_in_the_plane_that_is_looked_at():
    place = on_plane(np.zeros(3), np.array([0.0, -10.0, 0.0]), np.array([1.0, 2.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    assert place == pytest.approx([5.0, 0.0, 0.0])
    along = on_plane(np.array([3.0, 1.0, 0.0]), np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    assert along == pytest.approx([3.0, 0.0, 0.0])


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)
