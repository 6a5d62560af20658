"""The five-element robot has the paper's sizes, and its dish fits the cell."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.author import robots

CELL_RADIUS = 3.0


def _by_name(body) -> dict:
    return {sphere.prim.rsplit("/", 1)[1]: sphere for sphere in body.spheres}


@pytest.mark.parametrize("sweep", [robots.SWEEP, 0.0])
def test_sizes_are_those_of_the_paper(sweep: float):
    spheres = _by_name(robots.five_element_robot("/World/r", (0.0, 0.0, 8.0), sweep=sweep))
    left, right = np.array(spheres["handle_left"].offset), np.array(spheres["handle_right"].offset)
    assert np.linalg.norm(left - right) == pytest.approx(9.55)
    assert 2 * spheres["handle_left"].radius == pytest.approx(3.05)
    assert 2 * spheres["arm_left"].radius == pytest.approx(1.8)
    assert left[2] > spheres["hub"].offset[2]  # bowed upwards
    held = np.array([spheres[e].offset for e in robots.HELD_ELEMENTS])
    assert held.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-6)


def test_elements_are_trapped_and_only_the_dish_meets_the_cell():
    spheres = _by_name(robots.five_element_robot("/World/r", (0.0, 0.0, 8.0)))
    assert {name for name, s in spheres.items() if s.trapped} == set(robots.ELEMENTS)
    assert {name for name, s in spheres.items() if not s.collides} == {"hub"}
    seat = np.array([robots.seat_distance(CELL_RADIUS), 0.0, 0.0])
    gaps = {n: np.linalg.norm(np.array(s.offset) - seat) - s.radius - CELL_RADIUS for n, s in spheres.items()}
    for name, gap in gaps.items():
        if name.startswith("ring"):
            assert gap == pytest.approx(0.0, abs=1e-5)
        else:
            assert gap > 0.0, name


@pytest.mark.parametrize("facing", [1, -1])
def test_traps_hold_the_elements_of_a_robot_facing_either_way(facing: int):
    robot = robots.five_element_robot("/World/r", (1.0, 2.0, 8.0), facing=facing)
    hub = robots.element_position(robot, "hub")
    assert np.sign(hub[0] - 1.0) == facing
    for trap in robots.traps_on(robot, "/World/Traps/left", power=4.0, hand="left"):
        element = trap.holds.rsplit("/", 1)[1]  # type: ignore[union-attr]
        rest = trap.position.at(0.0) + np.array([0.0, 0.0, trap.equilibrium])
        assert rest == pytest.approx(robots.element_position(robot, element), abs=2e-6)
    assert robots.element_position(robot, "handle_left")[1] == pytest.approx(2.0 + facing * 4.775)
