"""Distances of many points from each shape, against the twins of one point."""

import numpy as np
import pytest

from otwarp.scene.obstacle_shapes import ROUND, SHAPES
from tests.reference import obstacles as twin

SIZE = np.array([1.5, 0.7, 2.0])


@pytest.mark.parametrize("name", [name for name, shape in SHAPES.items() if shape.distance is not None])
def test_distances_are_those_of_the_twin(name: str):
    points = np.random.default_rng(1).uniform(-3.0, 3.0, (200, 3))
    distance = SHAPES[name].distance
    assert distance is not None
    expected = [twin.SHAPES[name](point, SIZE)[0] for point in points]
    np.testing.assert_allclose(distance(points, SIZE), expected, rtol=0.0, atol=1e-14)


def test_every_shape_has_its_twin_and_only_meshes_have_no_distance():
    assert set(SHAPES) == {*twin.SHAPES, "mesh"}
    assert [name for name, shape in SHAPES.items() if shape.distance is None] == ["mesh"]


def test_a_solid_with_flat_ends_is_one_about_an_axis():
    assert ROUND == {"Cylinder": "cylinder", "Capsule": "capsule"}
    assert all(shape.round for shape in SHAPES.values() if shape.top is not None)
