"""Robots, cells, meshes and ways in one call each; what is authored loads back."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import SceneBuilder, Settings, Track

QUARTER = (0.0, 0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5)))
"""Turned by 90° about z."""


def test_a_robot_has_a_trap_on_each_handle() -> None:
    builder = SceneBuilder(settings=Settings(duration=2.0))
    way = Track.line((0, 0, 0), (6, 0, 0), speed=4.0, rest=0.5)
    made = builder.add_robot(
        "/World/robot", [(0, -3, 0), (0, 3, 0), (0, 0, 0)], [1.0, 1.0, 0.5], handles=[0, 1],
        position=(0, 0, 9), orientation=QUARTER, power=5.0, path=way,
    )  # fmt: skip
    builder.add_cell("/World/cell", (8, 0, 9), 2.0)
    scene = builder.scene()
    robot, cell = scene.bodies
    assert [s.trapped for s in robot.spheres] == [True, True, False] and cell.kind == "cell"
    assert scene.traps == made and [t.holds for t in made] == ["/World/robot/sphere_0", "/World/robot/sphere_1"]
    np.testing.assert_allclose(made[0].position.at(0.0), [3, 0, 9], atol=1e-6)
    np.testing.assert_allclose(made[0].position.at(1.0), [5, 0, 9], atol=1e-6)
    assert made[0].position.times[-1] == 2.0


def test_a_mesh_is_an_obstacle() -> None:
    trimesh = pytest.importorskip("trimesh")
    builder = SceneBuilder()
    found = builder.add_mesh("/World/block", trimesh.creation.box((4, 4, 2)), position=(0, 0, 1), kind="chamber")
    (obstacle,) = builder.scene().obstacles
    assert obstacle.shape == "mesh" and np.array_equal(obstacle.triangles, found.triangles)


def test_ways_have_their_speed() -> None:
    square = Track.polyline([(0, 0, 0), (4, 0, 0), (4, 2, 0)], speed=2.0)
    np.testing.assert_allclose(square.times, [0.0, 2.0, 3.0])
    circle = Track.circle((1, 2, 3), 5.0, speed=10.0, turns=-0.5, start=90.0, rest=1.0)
    np.testing.assert_allclose(circle.at(0.5), [1, 7, 3])
    np.testing.assert_allclose(circle.at(circle.times[-1]), [1, -3, 3], atol=1e-12)
    assert circle.at(1.1)[0] > 1.0  # clockwise
    assert circle.times[-1] - 1.0 == pytest.approx(0.5 * np.pi, rel=2e-4)
    middle = circle.at_times(np.linspace(1.0, circle.times[-1], 999))
    assert np.abs(np.linalg.norm(middle - (1, 2, 3), axis=1) / 5.0 - 1.0).max() < 4e-4
    tilted = Track.circle((0, 0, 0), 2.0, speed=1.0, normal=(1, 0, 0))
    np.testing.assert_allclose(tilted.values[:, 0], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Track.line((0, 0, 0), (1, 0, 0), speed=0.0), "speed, rest = 0 µm/s, 0 s"),
        (lambda: Track.line((0, 0, 0), (0, 0, 0), speed=1.0), "must be strictly increasing"),
        (lambda: Track.polyline([(0, 0, 0)], speed=1.0), r"points = shape \(1, 3\)"),
        (lambda: Track.circle((0, 0, 0), -1.0, speed=1.0), "radius, turns = -1 µm, 1"),
        (lambda: Track.circle((0, 0, 0), 1.0, speed=1.0, normal=(0, 0, 0)), "normal = .* must be a direction"),
        (lambda: SceneBuilder().add_robot("/World/r", [(0, 0, 0)], 1.0, handles=[1]), "handles = 1: must be numbers"),
        (lambda: SceneBuilder().add_robot("/World/r", [], 1.0), "centres = shape"),
    ],
)
def test_what_makes_no_sense_is_refused(make, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()
