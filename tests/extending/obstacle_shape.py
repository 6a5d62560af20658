"""A cone, from a file to a sphere at rest on its flank, and to what draws it."""

import numpy as np
import pytest

import otwarp as ot
from otwarp.record.footprint import surface_points
from otwarp.scene import Body, Obstacle, SceneBuilder, Settings, Sphere, Track
from otwarp.scene.drawing.draw_list import TUBE
from otwarp.scene.obstacle_shapes import SHAPES
from otwarp.teleop.page.compose import _obstacle

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
CONE = Obstacle(
    prim="/World/cone",
    shape="cone",
    size=(3.0, 2.0, 0.0),
    position=Track.constant((0.0, 0.0, 0.0)),
    orientation=Track.constant(UPRIGHT),
)
NORMAL = np.array([0.8, 0.0, 0.6])
"""Of the flank at y = 0; its middle is at x = 1.5."""


def authored(folder, gap: float):
    builder = SceneBuilder(settings=Settings(brownian=False))
    builder.add(CONE)
    place = tuple(float(x) for x in (1.5, 0.0, 0.0) + (1.0 + gap) * NORMAL)
    push = tuple(float(x) for x in -2.0 * NORMAL)
    ball = Sphere(prim="/World/B/S", radius=1.0)
    builder.add(Body(prim="/World/B", position=place, spheres=(ball,), forces={"external_force": push}))
    return builder.save(folder / "cone.usda")


def test_a_sphere_rests_on_the_flank(tmp_path, device):
    scene = ot.Scene.load(authored(tmp_path, 0.3))
    assert scene.obstacles[0].shape == "cone" and scene.obstacles[0].size == CONE.size
    sim = ot.Simulation(scene, device=device)
    sim.run(0.02)
    place = sim.state.position.numpy()[0, 0] - (1.5, 0.0, 0.0)
    assert place @ NORMAL == pytest.approx(1.0, abs=0.01)  # less what 2 pN press in
    np.testing.assert_allclose(place - (place @ NORMAL) * NORMAL, 0.0, atol=1e-4)


def test_what_is_not_stepped_knows_it_too(tmp_path):
    with pytest.raises(ot.InputError, match="overlap with /World/cone"):
        ot.Scene.load(authored(tmp_path, -0.5))
    assert _obstacle(CONE)[:3] == (TUBE, (3.0, 3.0, 2.0), (0.0, 0.0))
    assert surface_points({"shape": "cone", "size": CONE.size}).max(axis=0) == pytest.approx((3.0, 3.0, 2.0), abs=1e-6)
    points = np.array([[0.0, 0.0, 5.0], [0.0, 0.0, -3.0], [4.0, 0.0, -2.0], [0.0, 0.0, -1.9], [2.3, 0.0, 0.6]])
    distance = SHAPES["cone"].distance
    np.testing.assert_allclose(distance(points, np.array(CONE.size)), [3.0, 1.0, 1.0, -0.1, 1.0], atol=1e-12)
