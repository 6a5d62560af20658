"""Robots in their own frame: axis, turns, other robots of the class, symmetries."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from otwarp.errors import InputError
from otwarp.scene import Scene
from otwarp.vision.datasets.robot import Robot, rotation

SCENE = Path(__file__).parents[3] / "scenes" / "strategy_b.usda"


def robot(centers: Any, radius: object = 0.5, **more: object) -> Robot:
    place = np.array(centers, dtype=float)
    size = np.broadcast_to(np.asarray(radius, dtype=float), len(place))
    return Robot.of_solids(place, place, size, np.full(len(place), 1.5), **more)  # type: ignore[arg-type]


def test_a_body_of_a_scene_lies_along_x() -> None:
    found = Robot.of_body(Scene.load(SCENE), "/World/robot")
    assert np.ptp(found.start[:, 0]) == pytest.approx(9.55) and abs(found.start[:, 1:]).max() < 2.5
    assert found.frame[0] == pytest.approx([0, 1, 0]) and found.frame[2] == pytest.approx([0, 0, 1])
    body = next(b for b in Scene.load(SCENE).bodies if b.name == "/World/robot")
    back = found.start[0] @ found.frame + found.center
    assert back == pytest.approx(body.spheres[0].offset)
    with pytest.raises(InputError, match="body is /World/none; allowed: /World/robot"):
        Robot.of_body(Scene.load(SCENE), "/World/none")


def test_tilt_lifts_the_long_axis_and_yaw_turns_it() -> None:
    assert rotation(90, 0)[:, 0] == pytest.approx([0, 0, 1])
    assert rotation(0, 90)[:, 0] == pytest.approx([0, 1, 0])
    assert rotation(30, 40, 77)[:, 0] == pytest.approx(
        [np.cos(np.pi / 6) * np.cos(np.pi / 4.5), np.cos(np.pi / 6) * np.sin(np.pi / 4.5), 0.5]
    )
    assert np.linalg.det(rotation(12, 34, 56)) == pytest.approx(1.0)
    pair = robot([[2, 0, 1], [-2, 0, 1]])
    assert pair.center == pytest.approx([0, 0, 1])
    assert pair.at(90).start[:, 2] == pytest.approx([2, -2]) and pair.at(0, 90).start[:, 1] == pytest.approx([2, -2])


@pytest.mark.parametrize(
    ("of", "axial", "order", "flip"),
    [
        (robot([[-2, 0, 0], [2, 0, 0]]), True, 1, True),
        (robot([[-2, 0, 0], [2, 0, 0]], [0.5, 0.6]), True, 1, False),
        (robot([[-2, 0, 0], [2, 0, 0], [0, 1, 0]]), False, 1, True),
        (robot([[-2, 0, 0], [2, 0, 0], [0, 1, 0], [0, -1, 0]]), False, 2, True),
        (robot([[-2, 0, 0], [3, 0, 0], *([0, np.cos(a), np.sin(a)] for a in np.arange(3) * 2 * np.pi / 3)]), False, 3,
         False),
        (robot([[-2, 0, 0], [2, 0.3, 0], [0, 1, 0.7]]), False, 1, False),
    ],
)  # fmt: skip
def test_symmetries_are_found(of: Robot, axial: bool, order: int, flip: bool) -> None:
    found = of.symmetry()
    assert (found["axial"], found["order"], found["flip"]) == (axial, order, flip) and not found["spherical"]
    assert len(found["rotations"]) == order * (2 if flip else 1)
    for turn in found["rotations"]:
        moved = of.start @ np.array(turn).T
        assert all(np.abs(of.start - place).sum(axis=1).min() < 1e-6 for place in moved)


def test_a_sphere_is_a_sphere() -> None:
    assert robot([[1, 2, 3]]).symmetry()["spherical"]
    with pytest.raises(InputError, match="the robot has no spheres"):
        robot(np.zeros((0, 3)))


def test_others_of_the_class() -> None:
    other = robot([[-2, 0, 0], [2, 0, 0]]).varied(radius_scale=1.1, length_scale=0.5, index=1.4)
    assert other.radius == pytest.approx(0.55) and np.ptp(other.start[:, 0]) == pytest.approx(2.0)
    assert np.all(other.index == 1.4)


@pytest.mark.quick
def test_a_robot_is_the_same_however_it_was_given() -> None:
    start = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.2], [1.0, 0.8, -0.3], [1.4, -0.5, 0.4]])
    end, radius, index = start.copy(), np.array([1.0, 1.0, 0.4, 0.4]), np.full(4, 1.5)
    end[2] += [0.3, 0.2, 0.1]  # a rod
    one = Robot.of_solids(start, end, radius, index)
    turn = rotation(33.0, 140.0, 70.0)
    order = [3, 1, 0, 2]
    for axis in (None, np.array([0.2, 1.0, 0.0])):
        moved = [(e @ turn.T + [5.0, -2.0, 1.0])[order] for e in (end, start)]
        assert one.same(Robot.of_solids(*moved, radius[order], index, axis=axis))
    assert Robot.read(one.described()).same(one)
    mirror = np.diag([1.0, 1.0, -1.0])
    assert not one.same(Robot.of_solids(start @ mirror, end @ mirror, radius, index))
    for other in (Robot.of_solids(start, end, radius * 1.02, index), Robot.of_solids(start, end, radius, index + 0.02),
                  Robot.of_solids(start * 1.02, end * 1.02, radius, index),
                  Robot.of_solids(start[:3], end[:3], radius[:3], index[:3])):  # fmt: skip
        assert not one.same(other)
