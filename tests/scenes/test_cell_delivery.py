"""The numbers of the cell delivery: clear of obstacles at nominal speed, and in the window between held and lost."""

from __future__ import annotations

import numpy as np
import pytest

from otwarp.scene import Obstacle
from scenes.author import cell_delivery, robots, trap_laws

VISCOSITY = 0.00089
LEAST_CLEARANCE, FARTHEST_PASS = 1.0, 5.0  # [µm]: not touched, yet near; the pair lags its traps by 0.2 µm


def _pair_spheres() -> tuple[np.ndarray, np.ndarray]:
    centres, radii = [], []
    for body in cell_delivery.pair():
        turn = 1.0 if body.orientation[2] == 0.0 else -1.0
        for sphere in body.spheres:
            x, y, z = sphere.offset
            centres.append(np.array(body.position) + np.array([turn * x, turn * y, z]))
            radii.append(sphere.radius)
    return np.array(centres), np.array(radii)


def _gap(obstacle: Obstacle, centres: np.ndarray, time: float) -> np.ndarray:
    d = centres - obstacle.position.at(time)
    if obstacle.shape == "plane":
        return d[:, 2]
    if obstacle.shape == "cylinder":
        e = np.stack([np.hypot(d[:, 0], d[:, 1]) - obstacle.size[0], np.abs(d[:, 2]) - obstacle.size[1]], axis=1)
    else:
        e = np.abs(d) - np.array(obstacle.size)
    return np.linalg.norm(np.maximum(e, 0.0), axis=1) + np.minimum(e.max(axis=1), 0.0)


@pytest.fixture(scope="module")
def closest() -> dict[str, float]:
    """Obstacle → least gap [µm] to the pair while it follows its traps exactly."""
    centres, radii = _pair_spheres()
    path = cell_delivery.path()
    return {
        obstacle.prim.rsplit("/", 1)[1]: min(
            float((_gap(obstacle, centres + move, time) - radii).min())
            for time, move in zip(path.times, path.values, strict=True)
        )
        for group in cell_delivery.obstacles().values()
        for obstacle in group
    }


def test_pair_passes_every_obstacle_without_touching(closest: dict[str, float]):
    assert min(closest.values()) > LEAST_CLEARANCE


def test_obstacles_come_near(closest: dict[str, float]):
    assert closest["pillar_1"] < FARTHEST_PASS
    assert closest["pillar_2"] < FARTHEST_PASS
    assert min(closest[f"cube_{i}"] for i in (1, 2, 3, 4)) < FARTHEST_PASS


def test_six_traps_and_four_cubes_move(closest: dict[str, float]):
    assert len(cell_delivery.traps()) == 6
    assert all(trap.position.animated for trap in cell_delivery.traps())
    assert all(o.position.animated for o in cell_delivery.obstacles()["cube"])
    assert {"pillar_1", "pillar_2", "cube_1", "cube_2", "cube_3", "cube_4", "floor"} < set(closest)


def test_path_is_smooth_and_of_the_wanted_length_and_duration():
    path = cell_delivery.path()
    speed = np.linalg.norm(np.diff(path.values, axis=0), axis=1) / np.diff(path.times)
    assert 150.0 < np.sum(speed * np.diff(path.times)) < 205.0
    assert 10.0 <= path.times[-1] <= 15.0
    assert speed.max() == pytest.approx(cell_delivery.CRUISE, rel=0.01)
    assert speed[0] == speed[-1] == 0.0
    acceleration = np.abs(np.diff(speed)) / np.diff(path.times[1:])
    assert acceleration.max() < 1.1 * np.pi / 2 * cell_delivery.CRUISE / cell_delivery.RAMP


def test_traps_squeeze_the_cell_with_the_preload():
    radii = [robots.element_radius(e) for e in robots.HELD_ELEMENTS]
    stiffness = sum(trap_laws.stiffness_of(trap_laws.RADIAL, r, cell_delivery.POWER) for r in radii)
    assert stiffness * cell_delivery.preload_shift() == pytest.approx(cell_delivery.PRELOAD)
    left, right = cell_delivery.traps()[1], cell_delivery.traps()[4]
    assert left.position.values[0, 0] < right.position.values[0, 0]


def test_drag_is_below_what_the_dishes_hold_at_nominal_speed_and_above_it_at_three_times():
    rim = np.arcsin(robots.RING_RADIUS / (cell_delivery.CELL_RADIUS + robots.RING_SPHERE_RADIUS))
    holding = 2 * cell_delivery.PRELOAD * np.tan(rim)
    drag = 6 * np.pi * VISCOSITY * cell_delivery.CELL_RADIUS * cell_delivery.CRUISE
    assert 1.5 * drag < holding < 2.5 * drag


def test_traps_keep_the_squeezed_pair_from_buckling():
    places = np.array([robots.element_offset(e)[0] for e in robots.HELD_ELEMENTS])
    stiffness = [
        trap_laws.stiffness_of(trap_laws.AXIAL, robots.element_radius(e), cell_delivery.POWER)
        for e in robots.HELD_ELEMENTS
    ]
    pitching = np.sum(stiffness * (places - np.average(places, weights=stiffness)) ** 2)
    assert pitching > 1.2 * cell_delivery.PRELOAD * robots.seat_distance(cell_delivery.CELL_RADIUS)


def test_trap_capacity_exceeds_the_drag_of_a_robot_at_nominal_speed():
    capacity = len(robots.HELD_ELEMENTS) * trap_laws.peak_force_of(trap_laws.RADIAL, cell_delivery.POWER)
    robot_drag = 6 * np.pi * VISCOSITY * 3.6 * cell_delivery.CRUISE  # 3.6 µm: hydrodynamic radius of the robot
    assert capacity > 3 * (robot_drag + cell_delivery.PRELOAD)
