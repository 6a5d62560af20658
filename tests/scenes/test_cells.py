"""Stages of many cells hold the cells they promise, clear of each other and of everything else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from otwarp.scene import Scene
from scenes.author import cells, microfluidic_channel, robots
from scenes.author.__main__ import FOLDER


def _cells(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    cells = [body for body in scene.bodies if body.kind == "cell"]
    return np.array([c.position for c in cells]), np.array([c.spheres[0].radius for c in cells])


@pytest.mark.parametrize(("name", "count"), [("ten_thousand_cells", 10_000), ("microfluidic_channel", 200)])
def test_cells_are_as_many_as_promised_and_do_not_overlap(name: str, count: int):
    centres, radii = _cells(Scene.load(FOLDER / f"{name}.usda"))
    assert len(centres) == count
    assert 3.0 <= radii.min() <= radii.max() <= 4.0
    pairs = cKDTree(centres).query_pairs(2 * radii.max(), output_type="ndarray")
    distance = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
    assert np.all(distance > radii[pairs[:, 0]] + radii[pairs[:, 1]])


def test_cells_of_the_channel_keep_off_pillars_plates_walls_and_robot():
    centres, radii = _cells(Scene.load(FOLDER / "microfluidic_channel.usda"))
    for x, y, radius in microfluidic_channel.PILLARS:
        assert np.all(np.hypot(centres[:, 0] - x, centres[:, 1] - y) > radius + radii)
    assert np.all(centres[:, 2] > radii)
    assert np.all(centres[:, 2] < 2 * microfluidic_channel.HALF_HEIGHT - radii)
    assert np.all(np.abs(centres[:, 1]) < microfluidic_channel.HALF_Y - radii)
    robot = robots.five_element_robot("/r", (*microfluidic_channel.ROBOT_AT, microfluidic_channel.HALF_HEIGHT))
    reach = max(np.linalg.norm(s.offset) + s.radius for s in robot.spheres)
    assert np.all(np.linalg.norm(centres - np.array(robot.position), axis=1) > reach + radii)


def test_flow_of_the_channel_is_poiseuille_in_its_mid_plane():
    flow = Scene.load(FOLDER / "microfluidic_channel.usda").flow
    assert flow is not None
    assert flow.kind == "poiseuille"
    assert flow.origin[2] == flow.half_height == microfluidic_channel.HALF_HEIGHT


def test_scatter_says_when_the_points_do_not_fit():
    low, high = np.zeros(3), np.ones(3)
    with pytest.raises(ValueError, match="count = 50: only"):
        cells.scatter(50, low, high, gap=0.9, seed=1, keep_off=np.zeros((0, 4)))
